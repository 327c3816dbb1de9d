#include "diagnosis/proposal/mass_drive.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "diagnosis/log_columns/log_time.hpp"
#include "diagnosis/proposal/column_choice.hpp"
#include "diagnosis/recording_files/written_unit.hpp"
#include "diagnosis/signal_faults/counter_wrap.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

class DriveSearch {
 public:
  DriveSearch(MassMachine& machine, ModelProposal& proposal)
      : machine_(machine), proposal_(proposal) {}

  void run() {
    collect_open_columns();
    choose_the_drive();
  }

 private:
  // Columns that move and of which no one knows what they are.
  void collect_open_columns() {
    for (const LogColumn* column : machine_.columns) {
      if (column->words.quantity == LogQuantity::kUnknown && column->moves() &&
          !column->counts_rows() && !rises_as_time(column->values)) {
        machine_.open.push_back(column);
      }
    }
  }

  void choose_the_drive() {
    machine_.drive = machine_.likely_drive = goal_among(machine_.columns);
    if (machine_.drive != nullptr) {
      require_numbers(*machine_.drive);
      if (machine_.request.no_drive) {
        throw InputError(fmt::format(
            "--no-drive: '{}' is the goal of a servo, which drives: leave one of both out",
            machine_.drive->name));
      }
      return take_goal();
    }
    for (const LogColumn* column : machine_.columns) {
      if (column->answered && drives(column->words.quantity)) require_numbers(*column);
    }
    if (machine_.request.no_drive) {
      add_guess(proposal_, "drive", "nothing", "you said so: no force acts in these logs");
      return;
    }
    ColumnChoice choice = choose_drive(machine_.columns, machine_.recordings);
    const bool has_motion = !moving_columns(machine_.columns, LogQuantity::kPosition).empty() ||
                            !moving_columns(machine_.columns, LogQuantity::kVelocity).empty();
    if (choice.column == nullptr && choice.rivals.empty()) {
      if (machine_.open.empty() && !has_motion) {
        throw InputError(
            fmt::format("{}: no column is a force, torque, current, voltage or command that moves; "
                        "say which by --column NAME=torque{}",
                        machine_.log.files.front().string(), still_columns(machine_.columns)));
      }
      if (machine_.open.size() == 1 && !has_motion && !has_still_drive()) {
        return ask_the_only_column();
      }
      if (machine_.open.size() == 1 && has_motion) {
        choice = {machine_.open.front(), "guessed: the only column left", {}};
        machine_.open.clear();
      } else {
        choice.rivals = machine_.open;
      }
    }
    if (choice.column == nullptr) {
      proposal_.questions.push_back(
          choice.rivals.empty()  ? question_of_no_drive(machine_.columns)
          : choice.doubt.empty() ? question_of_drives(choice.rivals, machine_.motion_of_drive())
                                 : question_of_doubt(choice, machine_.open));
      if (has_motion && !choice.rivals.empty())
        offer_goals(machine_.columns, proposal_.questions.back());
      machine_.likely_drive = choice.rivals.empty() ? nullptr : choice.rivals.front();
      return;
    }
    if (!has_motion && may_be_measured_value(*choice.column)) return;
    machine_.drive = machine_.likely_drive = choice.column;
    add_guess(proposal_, "drive", fmt::format("'{}'", machine_.drive->name), choice.reason);
    if (!choice.doubt.empty()) proposal_.notes.push_back(choice.doubt);
    note_reference(*machine_.drive, proposal_.notes);
    if (!machine_.drive->words.odd_unit.empty()) ask_unit_of_drive();
    find_wrap_of_drive();
  }

  [[nodiscard]] bool has_still_drive() const {
    return std::ranges::any_of(
        machine_.columns, [](const LogColumn* column) { return drives(column->words.quantity); });
  }

  // One column of values holds the drive or the motion, and never both.
  void ask_the_only_column() {
    const std::string& name = machine_.open.front()->name;
    OpenQuestion question;
    question.text = fmt::format(
        "Is '{}' what drives, or what was measured? It is the only column that may be either, and "
        "a model needs both, unless nothing drives",
        name);
    question.option = fmt::format(
        "--column '{0}=position' or --column '{0}=velocity', and --no-drive, if nothing drives; "
        "else give a log with both",
        name);
    question.choices = {
        {"a position, and nothing drives", {name + "=position"}, true},
        {"a velocity, and nothing drives", {name + "=velocity"}, true},
    };
    proposal_.questions.push_back(question);
    machine_.likely_drive = machine_.open.front();
  }

  // A controller's log: "target, current, pwm". Nothing else moves there, and another column
  // drives.
  bool may_be_measured_value(const LogColumn& chosen) {
    const bool is_bare = chosen.words.quantity == LogQuantity::kCurrent && !chosen.answered &&
                         chosen.words.unit.empty() && chosen.words.odd_unit.empty();
    if (!is_bare) return false;
    const auto drives_too = [&](const LogColumn* column) {
      const LogQuantity quantity = column->words.quantity;
      return column->moves() && drives(quantity) && quantity != LogQuantity::kCurrent;
    };
    const auto drive = std::ranges::find_if(machine_.columns, drives_too);
    if (drive == machine_.columns.end()) return false;
    OpenQuestion question;
    question.text = fmt::format(
        "Is '{}' an electric current, or the current value of the motion, which no other title "
        "names? Then '{}' drives",
        chosen.name, (*drive)->name);
    question.option = fmt::format("--column '{}=position:deg', say, or --column '{}=current'",
                                  chosen.name, chosen.name);
    question.choices = {
        {"a position", {chosen.name + "=position"}},
        {"a velocity", {chosen.name + "=velocity"}},
        {"an electric current", {chosen.name + "=current"}},
    };
    proposal_.questions.push_back(question);
    machine_.likely_drive = *drive;
    machine_.open.push_back(&chosen);
    return true;
  }

  static void require_numbers(const LogColumn& column) {
    if (column.values.array().isFinite().any()) return;
    throw InputError(fmt::format("{}: column '{}' holds no numbers: name another column",
                                 column.file_name, column.name));
  }

  // The drive of a position servo: the difference of its goal and the position.
  void take_goal() {
    machine_.motion = machine_.motion_of_drive();  // for the words of the note
    add_guess(proposal_, "drive", fmt::format("'{}' - position", machine_.drive->name),
              "you said so: the goal of a servo");
    proposal_.notes.push_back(fmt::format(
        "'{}' is a reference: the servo drives by what is left to it, taken as 1 {} for each {} of "
        "goal - position (--gain states another). So the model has a spring of that stiffness, and "
        "the goal drives through it; all sizes are relative to this gain of the servo's",
        machine_.drive->name, machine_.force_unit(), machine_.is_linear() ? "m" : "rad"));
  }

  // A drive but a force or torque may be in a unit of its own: its gain is not known either.
  void ask_unit_of_drive() {
    const LogQuantity quantity = machine_.drive->words.quantity;
    const bool is_own = unit_as_written(machine_.drive->words.odd_unit).empty();
    if (is_own && quantity != LogQuantity::kForce && !machine_.request.gain) {
      proposal_.notes.push_back(
          fmt::format("'{}' is no unit that graybox knows: '{}' is taken as recorded",
                      machine_.drive->words.odd_unit, machine_.drive->name));
      return;
    }
    std::vector<std::string> units{"A", "mA"};
    const bool moves_linearly = machine_.motion_of_drive() == MotionKind::kLinear;
    if (quantity == LogQuantity::kForce) units = {"N m", "mN m", "N"};
    if (quantity == LogQuantity::kForce && moves_linearly) units = {"N", "kN", "N m"};
    if (quantity == LogQuantity::kVoltage) units = {"V", "mV"};
    if (quantity == LogQuantity::kCommand) units = {"V", "A", "1"};
    units.emplace_back("%");
    const bool is_torque = quantity == LogQuantity::kForce && !moves_linearly &&
                           machine_.drive->words.motion == MotionKind::kRotary;
    proposal_.questions.push_back(
        question_of_unit(*machine_.drive, is_torque ? "torque" : name_of(quantity), units));
  }

  // A signed number that was read as unsigned, in any of the logs.
  void find_wrap_of_drive() {
    for (const LogRecording& recording : machine_.recordings) {
      const LogColumn& column = recording.at(machine_.drive->file, machine_.drive->name);
      const Eigen::VectorXd recorded = without_gaps(column.values) / column.words.unit_factor;
      const std::optional<CounterWrap> wrap = find_wrap(recorded, 0.0);
      if (!wrap) continue;
      machine_.drive_period = wrap->period * column.words.unit_factor;
      proposal_.notes.push_back(fmt::format(
          "'{}' jumps by 2^{:g}, as a number with a sign does that was read without: it is "
          "unwrapped",
          machine_.drive->name, std::log2(wrap->period)));
      machine_.drive_wrap = fmt::format(", bits: {:g}", std::log2(wrap->period));
      return;
    }
  }

  MassMachine& machine_;
  ModelProposal& proposal_;
};

}  // namespace

void find_drive(MassMachine& machine, ModelProposal& proposal) {
  DriveSearch(machine, proposal).run();
}

}  // namespace graybox
