// Motion with a drive and without it: what a bridge that lets its motor go shows.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

// A drive up to this share of its largest is none.
inline constexpr double kNoDrive = 0.02;

// One recording of a drive and of the motion that it causes, at the same even times.
struct CoastingMotion {
  Eigen::VectorXd drive, motion;
  bool is_velocity = false;  // of the motion; else a position
};

// Whether 5 % of the squared speed, or more, was with a drive, and as much without, in 10 samples
// or more each in which it moved at a tenth of the largest speed. Cost O(samples).
[[nodiscard]] bool moves_without_drive(const std::vector<CoastingMotion>& recordings);

}  // namespace graybox
