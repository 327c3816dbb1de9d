#include "diagnosis/proposal/mass_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <vector>

#include "diagnosis/first_masses/one_mass_start.hpp"
#include "diagnosis/first_masses/undriven_gain.hpp"
#include "diagnosis/log_columns/motion_span.hpp"
#include "diagnosis/proposal/drive_manner.hpp"
#include "diagnosis/proposal/start_values.hpp"
#include "diagnosis/signal_faults/counter_wrap.hpp"
#include "diagnosis/signal_faults/held_values.hpp"
#include "diagnosis/signals/controlled_drive.hpp"
#include "diagnosis/signals/drive_work.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

constexpr double kGuessedResonance = 20.0;  // Hz

struct SpringStart {
  TwoMassStart values;
  std::string reason;
};

// Whether what is driven never comes back by more than a little of its way.
bool goes_one_way(const Eigen::ArrayXd& rate) {
  constexpr double kBack = 0.05;  // of the way
  double place = 0.0, most = 0.0, least = 0.0, back = 0.0, forth = 0.0;
  for (const double each : rate) {
    place += each;
    most = std::max(most, place);
    least = std::min(least, place);
    back = std::max(back, most - place);
    forth = std::max(forth, place - least);
  }
  return std::min(back, forth) <= kBack * (most - least);
}

// As --column takes it: "-deg", "-0.1 deg".
std::string reversed_unit(const MotionChoice& motion) {
  const double factor = -motion.column->words.unit_factor;
  if (factor == -1.0) return "-" + motion.unit;
  return factor == 1.0 ? motion.unit : fmt::format("{:g} {}", factor, motion.unit);
}

// What holds the axis at its goal: the goal drives through the same spring.
std::string servo_of(const MassMachine& machine) {
  if (!machine.has_goal()) return "";
  return fmt::format(
      "{:<46} # its gain: what is left to the goal drives\n"
      "    location: {{kind: element, mass: axis}}\n    law: stiffness\n"
      "    parameters: {{stiffness: {{value: {:g}, unit: {}, fixed: true}}}}\n",
      "  - name: servo", machine.force_factor, machine.is_linear() ? "N/m" : "N m/rad");
}

// A spring and a damper between motor and load, and viscous friction of the motor and maybe the
// load.
std::string elements_of_two(const TwoMassStart& start, const std::string& stiffness,
                            const std::string& damping, bool has_load_bearing) {
  constexpr double kBearing = 0.1;  // of the coupling's damping
  std::string text = fmt::format(
      "elements:\n  - name: coupling\n    location: {{kind: element, between: [motor, load]}}\n"
      "    law: stiffness\n    parameters: {{stiffness: {{value: {:.4g}, unit: {}}}}}\n"
      "  - name: coupling_damping\n    location: {{kind: element, between: [motor, load]}}\n"
      "    law: viscous\n    parameters: {{damping: {{value: {:.4g}, unit: {}}}}}\n",
      start.stiffness, stiffness, start.damping, damping);
  for (const std::string mass : {"motor", "load"}) {
    if (mass == "load" && !has_load_bearing) continue;
    text += fmt::format(
        "  - name: {0}_bearing\n    location: {{kind: element, mass: {0}}}\n    law: viscous\n"
        "    parameters: {{damping: {{value: {1:.4g}, unit: {2}}}}}\n",
        mass, kBearing * start.damping, damping);
  }
  return text;
}

// A motion that nothing drives shows how far one mass moves beside the other where both are
// measured. One sensor shows how fast they swing: neither their sizes nor the load's friction.
bool is_load_unseen(const MassMachine& machine) {
  return machine.request.no_drive && machine.motions.size() < 2;
}

// Behind the start of two masses.
std::string who_is_held(const MassMachine& machine) {
  if (!machine.request.no_drive) return "; they are fitted";
  return is_load_unseen(machine)
             ? "; no force acts: both are held, and all else is relative to them"
             : "; no force acts: the motor's is held, and all else is relative to it";
}

// The line "masses: {...}".
std::string masses_of_two(const MassMachine& machine, const SpringStart& start,
                          const std::string& unit) {
  const auto text_of = [](double value, bool is_held) {
    return is_held ? fmt::format("{{value: {:.4g}, fixed: true}}", value)
                   : fmt::format("{:.4g}", value);
  };
  const std::string masses = fmt::format("masses: {{motor: {}, load: {}}}",
                                         text_of(start.values.motor, machine.request.no_drive),
                                         text_of(start.values.load, is_load_unseen(machine)));
  return fmt::format("{:<46} # {}; {}\n", masses, unit,
                     machine.request.no_drive
                         ? "no force acts: all else is relative to what is held"
                         : start.reason);
}

// Nothing tells a mass: both are alike, and swing against each other at w with w^2 = 2 k/m.
SpringStart spring_of_free_motion(const MassMachine& machine, const LogTime& time,
                                  const ModelProposal& proposal) {
  double swings = 0.0;
  for (std::size_t k = 0; k < machine.motions.size() && proposal.questions.empty(); ++k) {
    if (swings > 0.0) break;
    const MotionChoice& motion = machine.motions[k];
    swings = swing_frequency(machine.even.of(motion.values(machine.log)), motion.is_velocity,
                             time.sample_time);
  }
  const double rate = 2.0 * std::numbers::pi * (swings > 0.0 ? swings : kGuessedResonance);
  const std::string why =
      swings > 0.0
          ? fmt::format("a start: both alike, a resonance at the {:.2g} Hz of the motion", swings)
          : fmt::format("a start: both alike, a resonance at {:g} Hz", kGuessedResonance);
  return {{1.0, 1.0, 0.5 * rate * rate, 0.02 * rate}, why};
}

// Seconds from the first row of a recording, of each row.
Eigen::VectorXd seconds_of(const LogRecording& recording, const LogTime& time) {
  if (!time.column.empty() && time.seconds() > 0.0) {
    const Eigen::VectorXd& stamps = recording.at(time.file, time.column).values;
    return time.seconds() * (stamps.array() - stamps(0));
  }
  const double step = time.sample_time / static_cast<double>(time.every);
  const Eigen::Index n = recording.samples();
  return Eigen::VectorXd::LinSpaced(n, 0.0, step * static_cast<double>(n - 1));
}

// What nothing drives only slows down, but for a weight or a spring, which give no more than they
// took. The first log in which something else acts is named.
void note_undriven_gain(const MassMachine& machine, const LogTime& time, ModelProposal& proposal) {
  const bool is_free = machine.request.no_drive && machine.drive == nullptr;
  const bool is_known = !machine.motions.empty() && machine.motions.front().column != nullptr &&
                        proposal.questions.empty();
  if (!is_free || !is_known) return;
  const MotionChoice& motion = machine.motions.front();
  for (const LogRecording& recording : machine.recordings) {
    const Eigen::VectorXd times = seconds_of(recording, time);
    const auto gain = find_undriven_gain(times, motion.values(recording), motion.is_velocity);
    if (!gain) continue;
    const std::string length = machine.is_linear() ? "m" : "rad", speed = length + "/s";
    const std::string where = fmt::format("between {:.3g} and {:.3g} s from the start of {}",
                                          times(gain->first), times(gain->last), recording.label());
    proposal.notes.push_back(
        gain->is_left_place
            ? fmt::format(
                  "'{}' leaves its rest by {:.3g} {} and comes back to it, {}, though nothing is "
                  "said to drive: a hand or a drive that was not logged; keep what follows alone "
                  "(segments in campaign.yaml)",
                  motion.column->name, gain->after, length, where)
            : fmt::format("{}'{}' grows from {:.3g} to {:.3g} {}, {}, though nothing is said to "
                          "drive: a weight pulls, or a drive that was not logged; add it to the "
                          "log, a constant one as a column of its value",
                          motion.is_velocity ? "" : "the rate of ", motion.column->name,
                          gain->before, gain->after, speed, where));
    return;
  }
}

// The mass speeds up against its drive: these are the words for it. Where the mass is negative
// beside a spring and beside a weight, what is left is a wrong sign.
std::string sign_words(const OneMassStart& start, const std::string& unit, const std::string& who) {
  const std::string turned = " (start values are those of the turned drive)";
  if (start.is_proved) {
    return fmt::format(
        "the drive acts reversed: beside an offset, friction, and a spring or a weight the mass "
        "stays negative, -{:.3g} +- {:.1g} {}. {}{}",
        start.proved, start.proved_error, unit, who, turned);
  }
  return fmt::format(
      "are the signs right? The mass would be negative, -{:.3g} {} within {:.0f} %: the axis "
      "speeds "
      "up against its drive. Either a spring or a weight holds the axis, and the signs are right "
      "as they are; or {}{}",
      start.inertia, unit, 100.0 * start.spread, who, turned);
}

// What drives in a recording, at even times: its size beside a speed without sign.
Eigen::VectorXd force_of(const MassMachine& machine, const LogRecording& recording,
                         const EvenSamples& even) {
  Eigen::VectorXd values = machine.driving_of(recording);
  const bool has_wraps = !machine.has_goal() && machine.drive_period > 0.0;
  if (has_wraps) values = unwrapped(values, machine.drive_period);
  const Eigen::VectorXd force = machine.force_factor * even.of(values);
  return machine.speed_way == 0.0 ? force : Eigen::VectorXd(machine.speed_way * force.cwiseAbs());
}

// Where a motion holds its values they may begin at another row of each log.
EvenSamples even_of(const MassMachine& machine, const LogRecording& recording, LogTime time) {
  if (&recording == &machine.log) return machine.even;
  const LogColumn* const column = machine.motions[0].column;
  if (time.every > 1) {
    const auto held =
        find_held_values(without_gaps(recording.at(column->file, column->name).values));
    time.from = held ? held->first % time.every : 0;
  }
  return EvenSamples(recording, time);
}

// Drive and speed of all recordings, in recorded numbers. Empty where no speed is known.
std::vector<DriveAndSpeed> drive_and_speed(const MassMachine& machine, const LogColumn& speed) {
  const auto recorded = [](const LogRecording& recording, const LogColumn& column) {
    return Eigen::VectorXd(without_gaps(recording.at(column.file, column.name).values) /
                           std::abs(column.words.unit_factor));
  };
  std::vector<DriveAndSpeed> all;
  for (const LogRecording& recording : machine.recordings) {
    all.push_back({recorded(recording, *machine.drive), recorded(recording, speed)});
  }
  return all;
}

// A drive that is a speed's target, or that a controller made of the speed.
void note_controller(const MassMachine& machine, ModelProposal& proposal) {
  const MotionChoice& motion = machine.motions[0];
  const LogColumn* const speed = motion.is_velocity   ? motion.column
                                 : motion.rate >= 0.0 ? motion.other
                                                      : nullptr;
  if (speed == nullptr || machine.drive == nullptr) return;
  const LogColumn& drive = *machine.drive;
  const std::vector<DriveAndSpeed> rows = drive_and_speed(machine, *speed);
  const Unit* const unit = find_unit(drive.words.unit);
  const bool may_be_speed = drive.words.unit.empty() || unit == nullptr ||
                            unit->base == find_unit("rad/s")->base ||
                            unit->base == find_unit("m/s")->base;
  const std::vector<double> levels = may_be_speed ? levels_of_target(rows) : std::vector<double>();
  if (!levels.empty()) {
    proposal.notes.push_back(fmt::format(
        "'{}' and '{}' settle at the same numbers ({:.4g}, {:.4g}): a reference of a speed "
        "controller? What drives is then not logged, and laws found describe the controller, too",
        drive.name, speed->name, levels.front(), levels.back()));
    return;
  }
  const bool is_command = drive.words.quantity != LogQuantity::kCurrent && !drive.words.is_measured;
  const auto feedback = is_command ? find_speed_feedback(rows) : std::nullopt;
  if (!feedback) return;
  proposal.notes.push_back(fmt::format(
      "'{0}' is made from '{1}' ('{0}' = {2:.3g} - {3:.3g} '{1}', to {4:.0f} %): a controller's "
      "output in its loop. At one target its gain can't be told from the machine's damping: record "
      "several targets, or steps of the drive itself",
      drive.name, speed->name, feedback->constant, feedback->gain,
      std::floor(100.0 * feedback->share)));
}

// What no axis does is a wrong unit.
void doubt_speed(const MassMachine& machine, const LogTime& time, ModelProposal& proposal) {
  constexpr double kFastest = 20.0, kFastestTurning = 2000.0;  // m/s, rad/s
  constexpr double kMost = 0.99;                               // of the samples: no spikes
  if (!(time.sample_time > 0.0)) return;
  std::vector<double> sizes;
  for (const LogRecording& recording : machine.recordings) {
    const Eigen::VectorXd place =
        even_of(machine, recording, time).of(machine.motions[0].values(recording));
    const Eigen::Index n = place.size();
    if (n < 2) continue;
    Eigen::ArrayXd rate = place.array().tail(n - 1);
    if (!machine.motions[0].is_velocity) {
      rate = (rate - place.array().head(n - 1)) / time.sample_time;
    }
    for (const double each : rate) sizes.push_back(std::abs(each));
  }
  if (sizes.empty()) return;
  const auto at =
      sizes.begin() + static_cast<std::ptrdiff_t>(kMost * static_cast<double>(sizes.size() - 1));
  std::ranges::nth_element(sizes, at);
  const bool is_linear = machine.is_linear();
  if (!(*at > (is_linear ? kFastest : kFastestTurning))) return;
  proposal.notes.push_back(fmt::format(
      "'{}' moves at {:.3g} {}, which few axes do: are its unit ({}) and that of the time right? "
      "--column '{}={}:UNIT' says another",
      machine.motions[0].column->name, *at, is_linear ? "m/s" : "rad/s", machine.motions[0].unit,
      machine.motions[0].column->name, machine.motions[0].is_velocity ? "velocity" : "position"));
}

// The largest share that a feedback of what was measured leaves of the drive, in any log; none
// where one of them can't tell.
std::optional<double> most_left_of_feedback(const MassMachine& machine, const LogTime& time,
                                            const LogColumn* other) {
  const MotionChoice& choice = machine.motions[0];
  double most = 0.0;
  for (const LogRecording& recording : machine.recordings) {
    const EvenSamples even = even_of(machine, recording, time);
    std::vector<Eigen::VectorXd> measured{even.of(choice.values(recording))};
    if (other != nullptr) {
      measured.push_back(even.of(without_gaps(recording.at(other->file, other->name).values)));
    }
    const std::optional<double> left =
        left_of_feedback(force_of(machine, recording, even), measured);
    if (!left) return {};
    most = std::max(most, *left);
  }
  return most;
}

// The largest share that the position alone, with its rate, leaves of the drive; none where it is
// not what a controller makes of it in each log. By the rows as they are: between them a step at
// the drive's sign would be smeared.
std::optional<double> most_left_of_position(const MassMachine& machine, const LogTime& time) {
  const MotionChoice& choice = machine.motions[0];
  if (choice.is_velocity || machine.drive_period > 0.0 || time.every > 1) return {};
  double most = 0.0;
  for (const LogRecording& recording : machine.recordings) {
    const std::optional<double> left = left_of_position_feedback(
        machine.force_factor * machine.driving_of(recording), choice.values(recording));
    if (!left) return {};
    most = std::max(most, *left);
  }
  return most;
}

// Nothing but a controller computes a drive that follows from what was measured.
bool note_feedback(const MassMachine& machine, const LogTime& time, ModelProposal& proposal) {
  constexpr double kExact = 0.01, kOfPosition = 0.04;  // of the drive's deviation
  const MotionChoice& choice = machine.motions[0];
  const bool has_other = choice.other != nullptr && choice.other->file == choice.column->file;
  const std::optional<double> left =
      most_left_of_feedback(machine, time, has_other ? choice.other : nullptr);
  const std::string& drive = machine.drive->name;
  const std::string& motion = choice.column->name;
  std::string words;
  if (left && *left <= kExact) {
    words = fmt::format(
        "'{}' (drive) is a sum of a constant and of '{}'{}, to {:.2g} % of its "
        "deviation",
        drive, motion, has_other ? fmt::format(" and '{}'", choice.other->name) : "",
        100.0 * *left);
  } else if (const auto rest = most_left_of_position(machine, time); rest && *rest <= kOfPosition) {
    words = fmt::format("'{}' (drive) follows from '{}' and its rate, to {:.2g} %", drive, motion,
                        100.0 * *rest);
  }
  if (words.empty()) return false;
  proposal.notes.push_back(
      fmt::format("{}: a controller computed it. Nothing else excites the machine, so {} can't "
                  "tell the machine "
                  "from its controller: move the goal, push, or add a signal to the drive",
                  words, machine.recordings.size() > 1 ? "these logs" : "this log"));
  return true;
}

class MassModel {
 public:
  MassModel(const MassMachine& machine, const LogTime& time, ModelProposal& proposal)
      : machine_(machine), time_(time), proposal_(proposal) {}

  std::string text() {
    std::string text =
        fmt::format("# Proposed by `{}`: {}. Change what is wrong.\n", machine_.request.command,
                    machine_.has_two ? "two masses and a spring" : "a mass with viscous friction");
    text += "format: graybox-lumped/1\n";
    const double step = time_.sample_time;
    text += step > 0.0 ? fmt::format("{:<46} # s\n", fmt::format("sample_time: {:g}", step))
                       : "sample_time: ANSWER  # ANSWER: s, as in campaign.yaml\n";
    text += fmt::format("motion: {}\n", machine_.is_linear() ? "translation" : "rotation");
    text += machine_.has_two ? two_masses() : masses();
    const std::string driven = machine_.has_two ? "motor" : "axis";
    text += fmt::format("inputs:\n  - {{name: {}, mass: {}}}\noutputs:\n", machine_.force_name(),
                        driven);
    for (std::size_t k = 0; k < machine_.motions.size(); ++k) {
      text += fmt::format("  - {{name: {}, mass: {}, quantity: {}}}\n", machine_.motion_name(k),
                          machine_.has_two ? machine_.sides[k] : driven,
                          machine_.motions[k].is_velocity ? "velocity" : "position");
    }
    if (machine_.motions.empty()) {
      text += fmt::format("  - {{name: {}, mass: {}, quantity: position}}\n",
                          machine_.is_linear() ? "position" : "angle", driven);
    }
    return text;
  }

 private:
  [[nodiscard]] std::string inertia_unit() const { return machine_.is_linear() ? "kg" : "kg m^2"; }

  [[nodiscard]] bool can_compute() const {
    return proposal_.questions.empty() && machine_.drive != nullptr && !machine_.motions.empty();
  }

  // At even times.
  [[nodiscard]] Eigen::VectorXd force() const {
    return force_of(machine_, machine_.log, machine_.even);
  }

  [[nodiscard]] Eigen::VectorXd motion(std::size_t k) const {
    return machine_.even.of(machine_.motions[k].values(machine_.log));
  }

  // All logs, since the order in which files are named means nothing. What is kept out of the fit
  // helps, too: only starts and notes come of it. `sign`: -1 turns the drive.
  [[nodiscard]] std::vector<OneMassLog> logs_of(double sign) const {
    const MotionChoice& motion = machine_.motions[0];
    std::vector<OneMassLog> logs;
    for (const LogRecording& recording : machine_.recordings) {
      const EvenSamples even = even_of(machine_, recording, time_);
      logs.push_back({sign * force_of(machine_, recording, even), even.of(motion.values(recording)),
                      motion.is_velocity, !machine_.is_linear(), time_.sample_time});
    }
    return logs;
  }

  // Beside a speed without sign none is reversed.
  [[nodiscard]] OneMassStart start_of(double sign) const {
    OneMassStart start = start_one_mass(logs_of(sign));
    const bool has_no_sign = machine_.speed_way != 0.0 && start.told == OneMassTold::kReversed;
    if (has_no_sign) start.told = OneMassTold::kNothing;
    return start;
  }

  // A drive or an encoder that counts the other way makes the mass negative. Turning either is the
  // same but for a velocity beside the position, which is a third witness: two that agree are
  // believed. A weight is none, since its direction is not known.
  [[nodiscard]] std::string who_is_reversed() const {
    const MotionChoice& motion = machine_.motions.front();
    const std::string drive = fmt::format("for the drive --gain={:g}", -machine_.force_factor),
                      encoder = fmt::format(
                          "for the encoder --column '{}={}:{}'", motion.column->name,
                          motion.is_velocity ? "velocity" : "position", reversed_unit(motion));
    std::string who = fmt::format(
        "'{}' (drive) or '{}' (encoder) is reversed, and this log can't "
        "tell which: say {}, or {}",
        machine_.drive->name, motion.column->name, drive, encoder);
    if (motion.rate < 0.0) {
      who = fmt::format(
          "'{}' (encoder) is reversed: '{}' agrees with the drive, and the rate of "
          "the encoder with neither: say {}",
          motion.column->name, motion.other->name, encoder);
    } else if (motion.rate > 0.0) {
      who = fmt::format("'{}' (drive) is reversed, or both '{}' and '{}', which agree: say {}",
                        machine_.drive->name, motion.column->name, motion.other->name, drive);
    }
    return who;
  }

  // A weight or a spring gives back one way what it took the other way; nothing gives both ways.
  [[nodiscard]] bool is_braked_both_ways() const {
    DriveWorkBothWays work;
    for (const OneMassLog& log : logs_of(1.0)) {
      work += drive_work(log.force, log.motion, log.is_velocity);
    }
    return takes_energy_both_ways(work);
  }

  void doubt_work() {
    proposal_.notes.push_back(fmt::format(
        "are the signs right? The drive acts against the motion both ways, which neither weight "
        "nor spring can bear: either a hand or another machine moves the axis, or {} (start values "
        "are those of the turned drive)",
        who_is_reversed()));
  }

  // Where the motion goes one way, a drive against it tells no sign: a load does the same.
  void note_braking() {
    constexpr double kMostly = 0.75;                 // of the samples
    double work = 0.0, braking = 0.0, acting = 0.0;  // samples: of a drive, on what moves
    std::vector<double> rates;
    for (const OneMassLog& log : logs_of(1.0)) {
      const Eigen::Index n = log.motion.size(), over = std::max<Eigen::Index>(1, n / 200);
      if (n != log.force.size() || n <= 2 * over) continue;
      Eigen::ArrayXd rate = log.motion.array().tail(n - over);
      if (!log.is_velocity) rate -= log.motion.array().head(n - over);
      const Eigen::ArrayXd power = log.force.array().tail(n - over) * rate;
      work += power.sum();
      braking += static_cast<double>((power < 0.0).count());
      acting += static_cast<double>((power != 0.0).count());
      rates.insert(rates.end(), rate.begin(), rate.end());
    }
    const bool is_braked = work < 0.0 && braking >= kMostly * acting;
    if (!is_braked || !goes_one_way(Eigen::Map<Eigen::ArrayXd>(rates.data(), std::ssize(rates)))) {
      return;
    }
    proposal_.notes.push_back(fmt::format(
        "'{}' (drive) acts against the motion, which goes one way: either a load drives the axis, "
        "as a weight or another machine, or drive or encoder is reversed. {} can't tell "
        "which; one that goes both ways can",
        machine_.drive->name, machine_.recordings.size() > 1 ? "These logs" : "This log"));
  }

  // A drive in N m or N is asked alone: others make masses of any size.
  void doubt_mass(const OneMassStart& start) {
    constexpr double kLargest = 1e4;  // kg m^2, kg
    const Unit* const unit = find_unit(machine_.drive->words.unit);
    const bool is_force = unit != nullptr && unit->base == (machine_.is_linear() ? "N" : "N m");
    if (start.told != OneMassTold::kInertia || !is_force || start.inertia < kLargest) return;
    proposal_.notes.push_back(fmt::format(
        "a mass of {:.3g} {} would move here: are the units of the drive, the motion and the time "
        "right?",
        start.inertia, inertia_unit()));
  }

  // The weight of a drive that never pushes back: a law of the model, since nothing else turns it.
  std::string weight(const OneMassStart& start) {
    const bool is_needed = start.told == OneMassTold::kInertia &&
                           (start.sine != 0.0 || start.cosine != 0.0) && !machine_.has_goal() &&
                           manner_of_drive(*machine_.drive, machine_.recordings).has_one_sign;
    if (!is_needed) return "";
    const char* why = "the drive never changes its sign, and the axis comes back";
    add_guess(proposal_, "weight",
              fmt::format("{:.3g} {} at most", std::hypot(start.sine, start.cosine),
                          machine_.force_unit()),
              fmt::format("{}; it is fitted", why));
    return fmt::format(
        "{:<46} # {}\n    location: {{kind: element, mass: axis}}\n    law: gravity\n"
        "    parameters: {{sine: {{value: {:.4g}, unit: N m}}, cosine: {{value: {:.4g}, unit: N "
        "m}}}}\n",
        "  - name: weight", why, start.sine, start.cosine);
  }

  std::string masses() {
    OneMassStart start;
    std::string why = machine_.request.no_drive ? "no force acts: all else is relative to it"
                                                : "guessed: open until the questions are answered";
    if (can_compute()) {
      start = start_of(1.0);
      const bool is_unexplained = !machine_.has_goal() && start.told != OneMassTold::kReversed;
      if (is_unexplained && is_braked_both_ways()) {
        doubt_work();
        start = start_of(-1.0);
      } else if (is_unexplained) {
        note_braking();
      }
      doubt_speed(machine_, time_, proposal_);
      if (!machine_.has_goal() && machine_.drive != nullptr) {
        doubt_mass(start);
        const bool has_sign = machine_.speed_way == 0.0;
        if (has_sign && !note_feedback(machine_, time_, proposal_))
          note_controller(machine_, proposal_);
      }
      switch (start.told) {
        case OneMassTold::kInertia:
          why = "a start: least squares of the motion on the drive and friction";
          break;
        case OneMassTold::kReversed:
          why = start.is_proved ? "that of the turned drive: as it is, the drive acts reversed"
                                : "guessed: that of the turned drive; as logged it is negative";
          proposal_.notes.push_back(sign_words(start, inertia_unit(), who_is_reversed()));
          break;
        case OneMassTold::kNothing:
          why = start.has_value ? "guessed: the log hardly shows an inertia"
                                : "guessed: drive and motion together tell no inertia";
      }
    }
    const std::string damping_unit = machine_.is_linear() ? "N s/m" : "N m s/rad";
    const char* const use = machine_.request.no_drive     ? "; it is held"
                            : proposal_.questions.empty() ? "; it is fitted"
                                                          : "";
    add_guess(proposal_, "mass", fmt::format("{:.3g} {}", start.inertia, inertia_unit()),
              why + use);
    add_guess(proposal_, "damping", fmt::format("{:.3g} {}", start.damping, damping_unit),
              machine_.request.no_drive ? "guessed; it is fitted" : "the same");
    const std::string value = machine_.request.no_drive
                                  ? fmt::format("{{value: {:.4g}, fixed: true}}", start.inertia)
                                  : fmt::format("{:.4g}", start.inertia);
    return fmt::format("{:<46} # {}; {}\n", fmt::format("masses: {{axis: {}}}", value),
                       inertia_unit(), why) +
           fmt::format(
               "elements:\n  - name: bearing\n    location: {{kind: element, mass: axis}}\n"
               "    law: viscous\n"
               "    parameters: {{damping: {{value: {:.4g}, unit: {}}}}}\n",
               start.damping, damping_unit) +
           servo_of(machine_) + weight(start);
  }

  SpringStart spring_start() {
    if (machine_.request.no_drive) return spring_of_free_motion(machine_, time_, proposal_);
    if (can_compute() && machine_.motions.size() == 2 &&
        machine_.motions[0].is_velocity == machine_.motions[1].is_velocity) {
      const auto found = start_two_masses(force(), motion(0), motion(1),
                                          machine_.motions[0].is_velocity, time_.sample_time);
      if (found) return {*found, "a start: least squares of both equations of motion"};
    }
    double total = 0.01;
    if (can_compute()) {
      const Eigen::VectorXd motor = motion(0);
      const auto found =
          start_one_encoder(force(), motor, machine_.motions[0].is_velocity, time_.sample_time);
      if (found) return {*found, "a start: antiresonance and resonance of the driven mass"};
      const OneMassStart one = start_of(1.0);
      if (one.told == OneMassTold::kInertia) total = one.inertia;
    }
    constexpr double kGuess = 2.0 * std::numbers::pi * kGuessedResonance;  // rad/s
    return {{0.5 * total, 0.5 * total, 0.25 * total * kGuess * kGuess, 0.01 * total * kGuess},
            fmt::format("a start: both alike, a resonance at {:g} Hz", kGuessedResonance)};
  }

  std::string two_masses() {
    SpringStart start = spring_start();
    TwoMassStart& values = start.values;
    const double critical = std::sqrt(values.stiffness * std::min(values.motor, values.load));
    if (!(values.damping > 0.0)) values.damping = 0.02 * critical;
    const std::string stiffness = machine_.is_linear() ? "N/m" : "N m/rad",
                      damping = machine_.is_linear() ? "N s/m" : "N m s/rad";
    add_guess(proposal_, "masses",
              fmt::format("{:.3g} and {:.3g} {}", values.motor, values.load, inertia_unit()),
              start.reason + who_is_held(machine_));
    add_guess(proposal_, "spring", fmt::format("{:.3g} {}", values.stiffness, stiffness),
              machine_.request.no_drive ? "the same; it is fitted" : "the same");
    return masses_of_two(machine_, start, inertia_unit()) +
           elements_of_two(values, stiffness, damping, !is_load_unseen(machine_)) + load_zero();
  }

  // The zeros of two position sensors differ.
  std::string load_zero() {
    if (machine_.motions.size() != 2 || machine_.motions[1].is_velocity || !can_compute())
      return "";
    return fmt::format(
        "  - name: load_zero                            # the sensors' zeros differ\n"
        "    location: {{kind: sensor, output: {}}}\n    law: offset\n"
        "    parameters: {{value: {{value: {:.4g}, unit: {}}}}}\n",
        machine_.motion_name(1), (motion(1) - motion(0)).mean(),
        machine_.is_linear() ? "m" : "rad");
  }

  const MassMachine& machine_;
  const LogTime& time_;
  ModelProposal& proposal_;
};

}  // namespace

std::string mass_model_text(const MassMachine& machine, const LogTime& time,
                            ModelProposal& proposal) {
  note_undriven_gain(machine, time, proposal);
  return MassModel(machine, time, proposal).text();
}

}  // namespace graybox
