// The unit of an angle from the steps of its encoder: 360/2048 are degrees, 2 pi/4096 radians.
//
// All values lie on a grid, within 2 % of its step, and the step is a turn over a usual number of
// counts: 2^8 to 2^20, or four times the lines of an encoder as it is sold. Values may be rounded
// to few decimals: 360/4096 is printed 0.09 and 0.08. Then they lie on the grid within that
// rounding, its step is five times the last decimal or more, and is known to 0.5 %. Steps of 1, 2,
// 2.5 or 5 times a power of ten are no proof, since numbers are printed so. Nor are up to 16
// levels.
// Cost: O(n log n).
//
// Counts a turn that a logged speed tells are off by about a thousandth: speeds are logged in three
// or four digits, and clocks are as wrong. A number that encoders have is taken within that.
//
//   find_encoder_steps(angle)              // {"deg", "360/2048"}
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

namespace graybox {

struct EncoderSteps {
  std::string unit;  // "deg" or "rad"
  std::string step;  // in it
};

// `values` are finite.
[[nodiscard]] std::optional<EncoderSteps> find_encoder_steps(const Eigen::VectorXd& values);

// The power of ten that all values are multiples of; 0: none above a millionth.
[[nodiscard]] double printed_step(const Eigen::VectorXd& values);

// The number of encoders within 0.1 % of an estimate: one of those above, or four times a number of
// two digits and zeros, as 2400, 1200 and 1320. None where there is none so near.
[[nodiscard]] std::optional<double> counts_of_encoders(double estimate);

}  // namespace graybox
