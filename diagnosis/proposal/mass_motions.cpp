#include "diagnosis/proposal/mass_motions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "diagnosis/proposal/column_choice.hpp"
#include "diagnosis/proposal/start_values.hpp"
#include "diagnosis/signal_faults/lost_sign.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Columns = std::vector<const LogColumn*>;

class MotionSearch {
 public:
  MotionSearch(MassMachine& machine, ModelProposal& proposal)
      : machine_(machine), proposal_(proposal) {}

  void run(const LogTime& time) {
    machine_.motion = machine_.motion_of_drive();
    const bool is_open = machine_.motion == MotionKind::kOpen;
    if (is_open) machine_.motion = MotionKind::kRotary;
    const MotionContext context{time.sample_time,
                                EvenSamples(machine_.log, time),
                                machine_.motion,
                                machine_.request.counts_per_turn,
                                machine_.request.sample_time.has_value(),
                                &time,
                                machine_.has_two || machine_.has_goal() ? nullptr : machine_.drive};
    if (machine_.has_two) {
      choose_two(context);
    } else {
      take_motion(choose_motion(machine_.columns, context), "");
    }
    require_counts();
    add_guess(proposal_, "motion", machine_.motion == MotionKind::kLinear ? "linear" : "rotary",
              machine_.request.motion != MotionKind::kOpen || is_answered() ? "you said so"
              : is_open ? "guessed: no title says; else say --linear"
                        : "the titles");
  }

 private:
  // The unit of the motion is the user's.
  [[nodiscard]] bool is_answered() const {
    return !machine_.motions.empty() && machine_.motions.front().column->answered &&
           motion_of_unit(machine_.motions.front().unit) == machine_.motion;
  }

  // Counts a turn that were stated and that no motion is in would change nothing.
  void require_counts() const {
    if (!machine_.request.counts_per_turn || machine_.motions.empty()) return;
    std::string motions;
    for (const MotionChoice& each : machine_.motions) {
      if (each.unit == "counts") return;
      motions +=
          fmt::format("{}'{}' is in {}", motions.empty() ? "" : ", ", each.column->name, each.unit);
    }
    throw InputError(fmt::format(
        "--counts-per-turn: {}, not in counts; leave it out, or say --column '{}=position:counts'",
        motions, machine_.motions.front().column->name));
  }

  void take_motion(MotionChoice choice, const std::string& side) {
    const std::string what =
        (side.empty() ? "" : side + " ") + (choice.is_velocity ? "velocity" : "position");
    for (const OpenQuestion& question : choice.questions) ask_once(proposal_, question);
    for (const std::string& note : choice.notes) proposal_.notes.push_back(note);
    if (choice.column == nullptr) {
      ask_for_motion(what);
      return;
    }
    if (choice.questions.empty()) {
      const ColumnWords& words = choice.column->words;
      const std::string unit = words.unit_factor == 1.0 ? choice.unit
                               : !words.written.empty()
                                   ? words.written
                                   : fmt::format("{:g} {}", words.unit_factor, choice.unit);
      add_guess(proposal_, what, fmt::format("'{}' in {}", choice.column->name, unit),
                choice.unit_reason.starts_with(choice.reason)
                    ? choice.unit_reason
                    : choice.reason + "; " + choice.unit_reason);
    }
    require_unit_of_the_motion(choice);
    machine_.sides.push_back(side);
    machine_.motions.push_back(std::move(choice));
  }

  // A title's unit decides how it moves; one that contradicts what was asked for is refused.
  void require_unit_of_the_motion(const MotionChoice& choice) {
    const MotionKind by_unit = choice.unit == "counts" || !choice.questions.empty()
                                   ? MotionKind::kOpen
                                   : motion_of_unit(choice.unit);
    if (by_unit == MotionKind::kOpen || by_unit == machine_.motion) return;
    if (machine_.request.motion == MotionKind::kOpen && machine_.motions.empty()) {
      machine_.motion = by_unit;
      return;
    }
    const std::string quantity = choice.is_velocity ? "velocity" : "position";
    const std::string unit = machine_.is_linear() ? (choice.is_velocity ? "m/s" : "m")
                                                  : (choice.is_velocity ? "rad/s" : "rad");
    throw InputError(fmt::format(
        "{}: column '{}' is in {}, but the motion is {}: say {}, or --column '{}={}:{}'",
        choice.column->file_name, choice.column->name, choice.unit,
        machine_.is_linear() ? "linear" : "rotary", machine_.is_linear() ? "--rotary" : "--linear",
        choice.column->name, quantity, unit));
  }

  void ask_for_motion(const std::string& what) {
    Columns left = machine_.open;
    std::erase(left, machine_.drive);
    for (const LogQuantity quantity : {LogQuantity::kPosition, LogQuantity::kVelocity}) {
      for (const LogColumn* column : moving_columns(machine_.columns, quantity)) {
        if (is_wanted(*column)) left.push_back(column);
        if (is_wanted(*column) || !is_guessed_switch(*column)) continue;
        left.push_back(column);
        proposal_.notes.push_back(fmt::format(
            "'{}' jumps between few values, as a switch does: it is not taken for the motion, "
            "though its letter may mean one",
            column->name));
      }
    }
    if (left.empty()) {
      throw InputError(fmt::format(
          "{}: no column is a {} or velocity that moves{}; say which by --column NAME=position{}",
          machine_.log.files.front().string(), what, still_columns(machine_.columns),
          words_of_accelerations(machine_.columns)));
    }
    // What the only column of a log is was asked already.
    if (machine_.drive == nullptr && left == Columns{machine_.likely_drive}) return;
    OpenQuestion question = which_of(left, "measured " + what + " or velocity");
    question.option = fmt::format("--column '{}=position:{}', say, or --column '{}=velocity:{}'",
                                  left.front()->name, machine_.is_linear() ? "m" : "rad",
                                  left.front()->name, machine_.is_linear() ? "m/s" : "rad/s");
    std::vector<AnswerChoice> choices;
    for (const AnswerChoice& each : question.choices) {
      choices.push_back({each.label + ", a position", {each.label + "=position"}});
      choices.push_back({each.label + ", a velocity", {each.label + "=velocity"}});
    }
    question.choices = std::move(choices);
    ask_once(proposal_, question);
  }

  // Both sides of a drive.
  void choose_two(const MotionContext& context) {
    Columns motor, load, open;
    for (const LogColumn* column : machine_.columns) {
      const bool is_load = column->words.side == DriveSide::kLoad || column->joint == "load";
      const bool is_motor = column->words.side == DriveSide::kMotor || column->joint == "motor";
      (is_motor ? motor : is_load ? load : open).push_back(column);
    }
    const auto count = [](const Columns& columns) {
      Columns moving = moving_columns(columns, LogQuantity::kPosition);
      const Columns velocities = moving_columns(columns, LogQuantity::kVelocity);
      moving.insert(moving.end(), velocities.begin(), velocities.end());
      return std::ranges::count_if(moving,
                                   [](const LogColumn* column) { return !is_wanted(*column); });
    };
    if (count(motor) == 0 && count(load) == 0) split_by_data(open, motor, load);
    if (count(motor) == 0) {
      motor.insert(motor.end(), open.begin(), open.end());
      if (count(motor) == 0) take_one_sensor(motor, load);
    } else if (count(load) == 0 && count(open) > 0) {
      load = open;
    }
    take_motion(choose_motion(motor, context), "motor");
    if (count(load) == 0) return;
    take_motion(choose_motion(load, context), "load");
  }

  // The only sensor, called an output or a load's, is taken for the motor's, as one without a side.
  void take_one_sensor(Columns& motor, Columns& load) {
    std::swap(motor, load);
    load.clear();
    for (const LogColumn* column : motor) {
      if (column->moves() && !is_wanted(*column)) {
        proposal_.notes.push_back(
            fmt::format("'{}' is the only motion: it is taken for the motor's; where it is the "
                        "load's, write its mass in model.yaml",
                        column->name));
        return;
      }
    }
  }

  static constexpr double kApart = 3.0;  // standard errors of two correlations

  // Two positions, or two velocities, without words for their side: the driven one follows the
  // force at once.
  void split_by_data(Columns& open, Columns& motor, Columns& load) {
    Columns measured;
    for (const LogQuantity quantity : {LogQuantity::kPosition, LogQuantity::kVelocity}) {
      measured.clear();
      for (const LogColumn* column : moving_columns(open, quantity)) {
        if (!column->words.is_reference) measured.push_back(column);
      }
      if (!measured.empty()) break;
    }
    if (measured.size() != 2 || machine_.drive == nullptr) return;
    const bool is_velocity = measured[0]->words.quantity == LogQuantity::kVelocity;
    const auto follows = [&](const LogColumn* column) {
      return std::abs(follows_at_once(machine_.drive->values, column->values, is_velocity));
    };
    const double first = follows(measured[0]), second = follows(measured[1]);
    const std::size_t driven = first >= second ? 0 : 1;
    motor = {measured[driven]};
    load = {measured[1 - driven]};
    const double more = std::max(first, second), less = std::min(first, second);
    add_guess(
        proposal_, "driven mass", fmt::format("'{}'", motor.front()->name),
        fmt::format("its acceleration follows the drive: correlation {:.2f}, of the other {:.2f}",
                    more, less));
    const double error = std::sqrt(2.0 / static_cast<double>(measured[0]->values.size()));
    if (more - less < kApart * error) {
      ask_once(proposal_, question_of_driven(measured, is_velocity));
    }
  }

  // Both follow the drive, as far as so many samples tell.
  static OpenQuestion question_of_driven(const Columns& measured, bool is_velocity) {
    const std::string quantity = is_velocity ? "velocity" : "position";
    OpenQuestion question;
    question.text = fmt::format("Which mass does the drive act on, that of '{}' or of '{}'?",
                                measured[0]->name, measured[1]->name);
    for (const std::size_t driven : {std::size_t{0}, std::size_t{1}}) {
      const std::string &motor = measured[driven]->name, &load = measured[1 - driven]->name;
      question.choices.push_back(
          {motor, {motor + "=" + quantity + "@motor", load + "=" + quantity + "@load"}});
    }
    const std::vector<std::string>& likely = question.choices.front().columns;
    question.option = fmt::format("--column '{}' --column '{}', say", likely[0], likely[1]);
    return question;
  }

  MassMachine& machine_;
  ModelProposal& proposal_;
};

}  // namespace

void find_motions(MassMachine& machine, const LogTime& time, ModelProposal& proposal) {
  MotionSearch(machine, proposal).run(time);
}

void find_lost_speed_sign(MassMachine& machine, ModelProposal& proposal) {
  const bool is_known =
      machine.drive != nullptr && !machine.has_goal() && machine.motions.size() == 1;
  if (!is_known || machine.has_two || machine.motions[0].column == nullptr) return;
  const MotionChoice& motion = machine.motions[0];
  if (!motion.is_velocity) return;
  // One behind the other: each log may go one way.
  std::vector<double> drive, speed;
  for (const LogRecording& recording : machine.recordings) {
    const Eigen::VectorXd force = machine.driving_of(recording), moved = motion.values(recording);
    if (force.size() != moved.size()) return;
    drive.insert(drive.end(), force.begin(), force.end());
    speed.insert(speed.end(), moved.begin(), moved.end());
  }
  const auto all = [](const std::vector<double>& values) {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
  };
  const auto lost = find_lost_sign(all(speed), all(drive));
  if (!lost) return;
  machine.speed_way = lost->is_negative ? -1.0 : 1.0;
  proposal.notes.push_back(fmt::format(
      "'{0}' never changes its sign while '{1}' does, and follows its size: a sensor that reads no "
      "sign? The start is that of the drive's size",
      motion.column->name, machine.drive->name));
}

}  // namespace graybox
