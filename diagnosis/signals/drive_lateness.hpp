// By how many samples a recorded drive comes later than the motion that it causes.
//
// A cause comes first: no machine moves before its drive acts. Where the motion follows best from
// what the drive is recorded to do some samples later, the drive is read late or behind a filter,
// or it answers the motion. Let v_i be the mean speed over m samples from i on, and u_j the mean
// drive over m samples from j on. Then
//   v_(i+m) = a v_i + b u_(i+m/2+k) + c sign(v_i) + d
// is fitted by least squares for each shift k, and the shift that leaves least is the lateness. Its
// span m is the shortest of 2, 4 and 8 samples over which speeds are told from noise. Source: an
// equation-error model with unknown dead time (Ljung, System Identification, 1999, section 4.2).
// Cost O(n) for each of 20 m shifts.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace graybox {

// Signals of one drive and what it moves, sampled evenly, of equal length.
struct LoggedDrive {
  Eigen::VectorXd force, motion;
  bool is_velocity = false;  // of the motion, else a position
};

// Whole samples, 1 at least; none where the drive is in time or comes first, where the motion does
// not follow from it, or where the shift makes too little difference.
[[nodiscard]] std::optional<Eigen::Index> drive_lateness(std::span<const LoggedDrive> logs);

}  // namespace graybox
