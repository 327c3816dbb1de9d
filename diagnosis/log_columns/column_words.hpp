// What a column's title says by itself: "joint_1_pos [deg]" is the position of number 1 in degrees.
//
// A title is cut into words at signs, at capitals within it and between letters and digits.
// Unit and quantity are words of a table (English and German, the commonest in French, Spanish and
// Italian, as loggers and drives write them).
// Letters alone ("q", "v", "u") count, but are not `sure`: data may correct them. The file's name
// is read the same way where a title has no quantity ("Joint_1" in pos_read_data.csv).
//
// A factor in a unit ("0.1 deg", "x10 mA", "deg/10") is kept beside it. A unit that the quantity
// can't have (a torque in mN), and what stands in brackets and is no unit that is known ("torque
// [furlong]"), is none: it is told by itself, to be asked about. Words that say which of several
// signals it is are no unit ("position (motor)", "q [filtered]"), nor is a remark of some length.
//
//   read_column_words("i_A", "").quantity            // LogQuantity::kCurrent, unit "A"
//   read_column_words("speed", "rpm").motion         // MotionKind::kRotary
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/recording_files/title_words.hpp"
#include "diagnosis/recording_files/written_unit.hpp"

namespace graybox {

// kForce holds torques, too. kCommand drives the machine in a unit that the title does not have.
// kOther is known and of no use here: temperatures, errors, states, the voltage of a supply.
enum class LogQuantity {
  kUnknown,
  kTime,
  kPosition,
  kVelocity,
  kAcceleration,
  kForce,
  kCurrent,
  kVoltage,
  kCommand,
  kOther
};
enum class MotionKind { kOpen, kRotary, kLinear };
enum class DriveSide { kOpen, kMotor, kLoad };

struct ColumnWords {
  LogQuantity quantity = LogQuantity::kUnknown;
  std::string unit;          // a name of units.hpp; empty if the title has none
  double unit_factor = 1.0;  // of that unit, for one that was recorded
  std::string written;       // that, as a bracket, the file or the user has it
  std::string odd_unit;      // as the title has it: no unit of the quantity, or none that is known
  MotionKind motion = MotionKind::kOpen;
  DriveSide side = DriveSide::kOpen;
  bool is_reference = false;  // desired, target, command
  bool is_measured = false;   // actual, measured, feedback
  bool is_filtered = false;
  bool sure = false;         // by a whole word or a unit
  std::optional<int> index;  // the first number of the title, or that in brackets behind it
};

// `stated_unit` is what the file says (RecordedColumn::unit), or empty.
[[nodiscard]] ColumnWords read_column_words(std::string_view title, std::string_view stated_unit);

// A title in two parts: "speed [turn/s]" is speed, in turn/s; "q[3]" is an array's third.
[[nodiscard]] std::pair<std::string, std::string> title_and_unit(const std::string& title);

// What a unit is of; kUnknown for "1" and others that may be anything.
[[nodiscard]] LogQuantity quantity_of_unit(std::string_view unit);
// A unit as written, of that quantity: a speed in Hz is in turns a second.
[[nodiscard]] WrittenUnit unit_of_quantity(std::string_view text, LogQuantity quantity);
[[nodiscard]] MotionKind motion_of_unit(std::string_view unit);
// Names of the units that a quantity can have, "N, kN, ..."; of all for kCommand and kUnknown.
[[nodiscard]] std::string known_units_of(LogQuantity quantity);

// "position", "velocity", ... as in `--column NAME=position`.
[[nodiscard]] const char* name_of(LogQuantity quantity);

[[nodiscard]] inline bool drives(LogQuantity quantity) {
  return quantity == LogQuantity::kForce || quantity == LogQuantity::kCurrent ||
         quantity == LogQuantity::kVoltage || quantity == LogQuantity::kCommand;
}

}  // namespace graybox
