// The work of a drive on a motion, each way apart.
//
// Friction takes energy whichever way a mass moves. A weight or a spring gives back one way what it
// took the other way. So a drive that takes energy out of a mass both ways, W = sum f dx < 0
// forwards and backwards, is counted the other way, or the motion is, or something else moves the
// mass.
#pragma once

#include <Eigen/Core>

namespace graybox {

struct DriveWork {
  Eigen::Index moving = 0;   // samples that move this way
  Eigen::Index against = 0;  // of these, in which the drive acts against the motion
  double work = 0.0;         // sum of force times displacement

  DriveWork& operator+=(const DriveWork& other);
};

// Whether three quarters of what moves goes against the drive, and the work is negative.
[[nodiscard]] bool takes_energy(const DriveWork& way);

struct DriveWorkBothWays {
  DriveWork forwards, backwards;

  DriveWorkBothWays& operator+=(const DriveWorkBothWays& other);  // of another recording
};

// The signals are sampled evenly and of equal length. Samples that hardly move or are missing do
// not count.
// Displacements are taken over as many samples as noise and counts ask for. Cost O(n).
[[nodiscard]] DriveWorkBothWays drive_work(const Eigen::VectorXd& force,
                                           const Eigen::VectorXd& motion, bool is_velocity);

[[nodiscard]] bool takes_energy(const DriveWorkBothWays& drive);  // of both ways together
// Whether at least a tenth moves each way, and each way takes energy.
[[nodiscard]] bool takes_energy_both_ways(const DriveWorkBothWays& drive);

}  // namespace graybox
