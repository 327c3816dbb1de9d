#include "diagnosis/proposal/mass_campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "diagnosis/first_masses/kept_out_blocks.hpp"
#include "diagnosis/log_columns/log_time.hpp"
#include "diagnosis/proposal/column_choice.hpp"
#include "diagnosis/proposal/mass_times.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

using Columns = std::vector<const LogColumn*>;

// What the units of the model then mean.
std::string words_of_unknown_gain(const MassMachine& machine, const std::string& unit) {
  const bool is_linear = machine.is_linear();
  return fmt::format(
      "'{}' is taken as it is, 1 {} for one {}: masses and laws come out in that unit, and 1 {} is "
      "one {} per {} (--gain states another)",
      machine.drive->name, machine.force_unit(), unit, is_linear ? "kg" : "kg m^2", unit,
      is_linear ? "m/s^2" : "rad/s^2");
}

class MassCampaign {
 public:
  MassCampaign(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal)
      : machine_(machine), draft_(draft), proposal_(proposal) {}

  void run() {
    draft_.heading =
        fmt::format("# Proposed by `{}`. Change what is wrong.\n", machine_.request.command);
    add_drive_channel();
    Columns decisive;
    for (std::size_t k = 0; k < machine_.motions.size(); ++k) {
      const MotionChoice& each = machine_.motions[k];
      std::string comment = each.unit_reason;
      if (!each.questions.empty() && !comment.starts_with("# ANSWER")) {
        comment = "# ANSWER: " + each.questions.front().text;
      }
      draft_.channels.push_back({machine_.motion_name(k), each.column->file, each.column->name,
                                 each.unit, each.gain, "output", comment});
      if (each.is_wrapped) draft_.wrapped.push_back({machine_.motion_name(k), each.wrap_period});
      decisive.push_back(each.column);
    }
    if (machine_.has_goal() && !machine_.motions.empty()) add_goal_channel();
    if (machine_.motions.empty()) {
      draft_.channels.push_back(
          {machine_.is_linear() ? "position" : "angle", 0, "ANSWER",
           machine_.is_linear() ? "m" : "rad", "", "output",
           "# ANSWER: which column is the motion? " + option_about("measured")});
    }
    note_gaps();
    note_unused();
    draft_.experiments =
        draft_experiments(machine_.recordings, decisive,
                          !machine_.motions.empty() && machine_.motions.front().is_velocity,
                          machine_.raw_step > 0.0 ? machine_.raw_step : draft_.time.sample_time,
                          machine_.request.split);
    split_in_blocks();
    note_sparse_rows(draft_, machine_.recordings.front(), proposal_.notes);
    note_arrival_times(machine_, draft_.time, proposal_.notes);
    if (draft_.time.every > 1) {
      for (DraftExperiment& each : draft_.experiments)
        each.from = first_of_held(machine_, draft_.time, each);
    }
    guess_what_is_kept_out();
  }

 private:
  [[nodiscard]] bool is_used(const LogColumn* column) const {
    return std::ranges::any_of(draft_.channels, [&](const DraftChannel& channel) {
      return channel.column == column->name && channel.file == column->file;
    });
  }

  void add_no_drive() {
    machine_.force_factor = 0.0;
    draft_.computed.push_back(
        fmt::format("  - {{kind: constant, name: {}, value: 0, unit: {}, is: input}}  # no force "
                    "acts\n",
                    machine_.force_name(), machine_.force_unit()));
  }

  void require_goal_of_position(const Unit& unit, bool is_stated) const {
    const std::string& name = machine_.drive->name;
    const std::string& odd = machine_.drive->words.odd_unit;
    const bool is_of_position = !is_stated || unit.base == (machine_.is_linear() ? "m" : "rad");
    if (!odd.empty() || !is_of_position) {
      throw InputError(fmt::format(
          "{}: column '{}': a goal in {} is none of a position in {}: say its unit by --column "
          "'{}=goal:{}'",
          machine_.drive->file_name, name, odd.empty() ? std::string(unit.name) : odd,
          machine_.motions.front().unit, name, machine_.is_linear() ? "mm" : "deg"));
    }
    if (machine_.motions.front().is_wrapped) {
      throw InputError(fmt::format(
          "{}: column '{}': the position wraps, and whether its goal is a whole turn away then "
          "can't be known: unwrap both in the log",
          machine_.drive->file_name, name));
    }
  }

  // Behind the motion, whose unit the goal has where none is stated. The servo's spring to the goal
  // is the goal as a force, and a spring to zero in the model.
  void add_goal_channel() {
    const MotionChoice& motion = machine_.motions.front();
    if (motion.is_velocity) {
      throw InputError(fmt::format(
          "--column '{}=goal': the drive of a servo is goal - position, and no position is "
          "recorded; say which by --column NAME=position",
          machine_.drive->name));
    }
    const std::string& own = machine_.drive->words.unit;
    const bool is_stated = !own.empty() && own != motion.unit;
    const Unit* unit = find_unit(is_stated ? own : motion.unit);
    require_goal_of_position(*unit, is_stated);
    machine_.goal_factor = is_stated ? unit->factor : motion.factor;
    machine_.force_factor = machine_.request.gain.value_or(1.0);
    const std::string gain = fmt::format("{{value: {:.10g}, unit: \"{}/{}\"}}",
                                         machine_.force_factor * machine_.goal_factor,
                                         machine_.force_unit(), unit->name);
    draft_.channels.push_back({machine_.force_name(), machine_.drive->file, machine_.drive->name,
                               std::string(unit->name), gain, "input",
                               is_stated ? "the goal" : "the goal, in the unit of the position"});
  }

  void add_drive_channel() {
    if (machine_.request.no_drive && machine_.drive == nullptr) return add_no_drive();
    if (machine_.has_goal()) return;
    if (machine_.drive == nullptr) {
      draft_.channels.push_back(
          {machine_.force_name(), 0, "ANSWER", "1", "", "input",
           "# ANSWER: which column drives the machine? " + option_about("drive")});
      return;
    }
    std::string unit = machine_.drive->words.unit.empty() ? "1" : machine_.drive->words.unit;
    if (machine_.drive->words.quantity == LogQuantity::kForce &&
        machine_.drive->words.unit.empty()) {
      unit = machine_.force_unit();
    }
    const Unit* known = find_unit(unit);
    const bool is_force =
        known != nullptr && known->base == machine_.force_unit() && !machine_.request.gain;
    const double gain = machine_.request.gain.value_or(1.0);
    const double recorded_gain = gain * machine_.drive->words.unit_factor;
    machine_.force_factor = is_force ? known->factor : gain;
    std::string comment =
        machine_.drive->words.unit.empty() && is_force ? "the unit is guessed" : "";
    std::string text;
    if (!is_force) {
      text =
          fmt::format("{{value: {:g}, unit: {}/{}}}", recorded_gain, machine_.force_unit(), unit);
      if (unit == "1") {
        text = fmt::format("{{value: {:g}, unit: \"{}/1\"}}", recorded_gain, machine_.force_unit());
      }
      if (!machine_.request.gain) {
        comment = fmt::format("1 {} stands for one recorded unit: its gain is not known",
                              machine_.force_unit());
        proposal_.notes.push_back(words_of_unknown_gain(machine_, unit == "1" ? "of it" : unit));
      }
    }
    // What is asked about it, as its unit: no command reads the file until that is answered.
    for (const OpenQuestion& question : proposal_.questions) {
      if (question.about == machine_.drive->name) {
        comment = "# ANSWER: " + question.text;
      }
    }
    draft_.channels.push_back({machine_.force_name(), machine_.drive->file, machine_.drive->name,
                               unit, text, "input", comment});
    if (!machine_.drive_wrap.empty())
      draft_.wrapped.push_back({machine_.force_name(), machine_.drive_wrap});
  }

  // The option that answers the question with this word; without one, the last question.
  [[nodiscard]] std::string option_about(std::string_view word) const {
    const std::vector<OpenQuestion>& questions = proposal_.questions;
    if (questions.empty()) return "";
    const auto own = std::ranges::find_if(questions, [&](const OpenQuestion& question) {
      return question.text.find(word) != std::string::npos;
    });
    return own == questions.end() ? questions.back().option : own->option;
  }

  // Halves of which one has no drive or no motion check nothing: then alternating blocks.
  void split_in_blocks() {
    const bool has_halves = machine_.request.split == SplitPlan::kMovingHalves ||
                            machine_.request.split == SplitPlan::kWholeHalves;
    const bool is_known = (machine_.drive != nullptr || machine_.request.no_drive) &&
                          !machine_.motions.empty() && machine_.motions[0].column != nullptr;
    if (!has_halves || !is_known || draft_.experiments.size() != 2 ||
        machine_.recordings.size() != 1) {
      return;
    }
    const Eigen::Index first = draft_.experiments.front().first,
                       count = draft_.experiments.back().last - first + 1;
    const Eigen::VectorXd drive = machine_.driving(),
                          moves = machine_.motions[0].values(machine_.log);
    blocks_ = kept_out_blocks(drive.segment(first, count), moves.segment(first, count),
                              machine_.motions[0].is_velocity);
    if (!blocks_.is_fair) {
      draft_.experiments = {{0, first, first + count - 1, false, false}};
      return;
    }
    if (blocks_.count < 3) return;
    draft_.experiments.clear();
    for (Eigen::Index k = 0; k < blocks_.count; ++k) {
      draft_.experiments.push_back({0, first + k * count / blocks_.count,
                                    first + (k + 1) * count / blocks_.count - 1, false,
                                    k % 2 == 1});
    }
  }

  void guess_what_is_kept_out() {
    const std::string few = "with less in the fit a diagnosis would have too few samples";
    const bool is_one = machine_.recordings.size() == 1;
    if (machine_.request.split == SplitPlan::kNoValidation)
      return add_guess(proposal_, "kept out", "nothing", few);
    if (!is_one && draft_.experiments.size() > machine_.recordings.size()) {
      add_guess(proposal_, "kept out", "every second part of each recording", kOppositeWays);
    } else if (!is_one) {
      const auto kept =
          std::ranges::find(draft_.experiments, true, &DraftExperiment::is_validation);
      const bool is_last = kept->recording + 1 == machine_.recordings.size();
      add_guess(proposal_, "kept out", machine_.recordings[kept->recording].label(),
                is_last ? "checks the fit" : "checks the fit, which has both ways without it");
    } else if (machine_.request.split == SplitPlan::kMostInFit) {
      add_guess(proposal_, "kept out", "the last quarter", "checks the fit; " + few);
    } else if (blocks_.count > 2) {
      add_guess(proposal_, "kept out", fmt::format("every second of {} parts", blocks_.count),
                blocks_.reason + ", so halves would not be alike");
    } else if (!blocks_.is_fair) {
      add_guess(proposal_, "kept out", "nothing",
                blocks_.reason + ", so no split gives each part its share");
      proposal_.notes.push_back(
          "nothing is kept out, so nothing will test what is found: record "
          "another run and give both logs");
    } else {
      add_guess(proposal_, "kept out", "the second half", "checks the fit");
    }
    if (machine_.request.split != SplitPlan::kMovingHalves) {
      add_guess(proposal_, "standstill", "kept",
                is_one && machine_.request.split == SplitPlan::kMostInFit ? "the same" : few);
    }
  }

  void note_gaps() {
    for (const DraftChannel& channel : draft_.channels) {
      for (const LogRecording& recording : machine_.recordings) {
        if (channel.column == "ANSWER") continue;
        if (!recording.at(channel.file, channel.column).has_gaps()) continue;
        draft_.gapped.push_back(channel.name);
        proposal_.notes.push_back(
            fmt::format("'{}' has rows without a number: they are left out", channel.column));
        break;
      }
    }
  }

  // From a force by a current and a voltage to a command, as LogQuantity lists them.
  [[nodiscard]] bool is_farther_than_drive(const LogColumn& column) const {
    return machine_.drive != nullptr && !machine_.drive->answered &&
           drives(column.words.quantity) && column.words.quantity > machine_.drive->words.quantity;
  }

  [[nodiscard]] std::string why_unused(const LogColumn& column) const {
    const LogQuantity quantity = column.words.quantity;
    if (!column.moves()) return "never changes";
    if (quantity == LogQuantity::kTime) return "another time";
    if (quantity == LogQuantity::kUnknown) {
      if (column.counts_rows()) return "numbers the rows";
      if (!rises_as_time(column.values)) return "not recognised";
      const bool is_whole = (column.values.array() == column.values.array().round()).all();
      if (is_whole) return "a counter";
      return rises_evenly(column.values) ? "rises evenly, as a time does"
                                         : "rises throughout, as a time does";
    }
    if (quantity == LogQuantity::kOther) {
      if (column.answered) return "you said so";
      return column.evidence.empty() ? "no motion, no drive" : column.evidence;
    }
    if (column.words.is_reference) return "a reference";
    if (is_farther_than_drive(column)) {
      return fmt::format("'{}', a {}, is nearer to the force", machine_.drive->name,
                         name_of(machine_.drive->words.quantity));
    }
    return "not needed";
  }

  // Several files may have the same clock; it is listed once.
  [[nodiscard]] bool is_the_time(const LogColumn& column) const {
    const bool is_its_file = column.file == draft_.time.file;
    return column.name == draft_.time.column &&
           (is_its_file || column.words.quantity == LogQuantity::kTime);
  }

  void note_unused() {
    for (const LogColumn& column : machine_.log.columns) {
      if (is_used(&column) || is_the_time(column)) continue;
      draft_.unused.push_back(fmt::format("{}: {}", column.name, why_unused(column)));
    }
    if (!draft_.unused.empty()) {
      std::string names;
      constexpr std::size_t kMost = 6;
      for (std::size_t k = 0; k < std::min(kMost, draft_.unused.size()); ++k) {
        names += (k == 0 ? "" : "; ") + draft_.unused[k];
      }
      if (draft_.unused.size() > kMost)
        names += fmt::format("; and {} more", draft_.unused.size() - kMost);
      add_guess(proposal_, "not used", names, "");
    }
  }

  MassMachine& machine_;
  CampaignDraft& draft_;
  ModelProposal& proposal_;
  KeptOutBlocks blocks_;
};

}  // namespace

void draft_mass_campaign(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal) {
  MassCampaign(machine, draft, proposal).run();
}

void relate_encoders(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal) {
  if (machine.motions.size() != 2 ||
      machine.motions[0].is_velocity != machine.motions[1].is_velocity)
    return;
  const Eigen::VectorXd motor = machine.motions[0].values(machine.log),
                        load = machine.motions[1].values(machine.log);
  const double alike = correlation(motor, load);
  const double slope = alike * std::sqrt((load.array() - load.mean()).square().sum() /
                                         (motor.array() - motor.mean()).square().sum());
  constexpr double kTogether = 0.5, kRigid = 0.98, kNoGear = 1.2;
  if (std::abs(alike) < kTogether) return;
  const double size = std::abs(slope);
  bool has_gear = std::abs(alike) > kRigid && (size > kNoGear || size < 1.0 / kNoGear);
  const bool are_stated = std::ranges::all_of(machine.motions, [](const MotionChoice& motion) {
    return motion.column->answered && !motion.column->words.unit.empty();
  });
  if (has_gear && are_stated) {
    proposal.notes.push_back(fmt::format(
        "the load moves {:.4g} times as far as the motor; both units are as you said. Behind a "
        "gear, state the load's unit with its factor (--column 'NAME=position:{:.4g} UNIT')",
        size, 1.0 / size));
    has_gear = false;
  }
  if (slope > 0.0 && !has_gear) return;
  const double factor = (has_gear ? 1.0 / size : 1.0) * (slope < 0.0 ? -1.0 : 1.0);
  machine.motions[1].factor *= factor;
  const auto of_load = std::ranges::find_if(draft.channels, [&](const DraftChannel& each) {
    return each.is == "output" && each.column == machine.motions[1].column->name;
  });
  if (of_load == draft.channels.end() || !of_load->gain.empty()) return;
  DraftChannel& channel = *of_load;
  const Unit* unit = find_unit(channel.unit);
  const std::string base(unit->base);
  channel.gain = fmt::format("{{value: {:.6g}, unit: {}/{}}}",
                             factor * unit->factor * machine.motions[1].column->words.unit_factor,
                             base, channel.unit);
  channel.comment = fmt::format("both move together by {:.4g} (correlation {:.2f})", slope, alike);
  add_guess(proposal, "load's sensor", fmt::format("times {:.4g}", factor), channel.comment);
}

}  // namespace graybox
