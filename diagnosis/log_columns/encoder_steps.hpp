// The unit of an angle from the steps of its encoder: 360/2048 are degrees, 2 pi/4096 radians.
//
// All values lie on a grid, within 2 % of its step, and the step is a turn over a usual number of
// counts: 2^8 to 2^20, or four times the lines of an encoder as it is sold. Steps of 1, 2, 2.5 or 5
// times a power of ten are no proof, since numbers are printed so. Nor are up to 16 levels.
// Cost: O(n log n).
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

}  // namespace graybox
