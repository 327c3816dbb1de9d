// Columns that say again what another one says: counts beside degrees, a duty cycle beside the
// command it was made of. Such a column tells nothing new, whatever its title is.
//
// Rule: a constant and a multiple of the other column leave less than 1e-4 of its deviation. What
// rounding does may be left, too: numbers on a grid of tenths, hundredths and so on, of either
// column, whose step is at most a hundredth of the deviation. No machine follows its drive so.
// Cost: O(n) a pair.
//
//   set_copies_aside(recordings, false, notes);
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/log_columns/log_recordings.hpp"

namespace graybox {

// By how much the original is multiplied; none: it is no copy, or one of them does not move.
[[nodiscard]] std::optional<double> factor_of_copy(const Eigen::VectorXd& copy,
                                                   const Eigen::VectorXd& original);

// Columns that are copies in all recordings, and of which the user said nothing, are kOther then:
//
// - where no column drives, what nobody knows and what is a copy of a measured motion. `has_drive`:
//   the user said that nothing drives, or which column does;
// - a position or velocity that is a command or a voltage again, times a positive factor, beside
//   another motion. A negative factor is a controller's feedback.
void set_copies_aside(std::vector<LogRecording>& recordings, bool has_drive,
                      std::vector<std::string>& notes);

}  // namespace graybox
