// Recorded velocities and accelerations that are not those of the recorded positions.
//
// Changes over windows of ten samples are compared, as recorded (of motors or joints), less their
// means. The change of a position is compared with the integral of a velocity. The change of a
// velocity is compared with the integral of an acceleration. Where one follows its own with a
// correlation above 0.9, but with another sign or a factor beyond 1/2 and 2 (filters may take a
// part), or its own below 0.5 and another's above 0.9, that is said. Rates that were differentiated
// from positions are theirs.
//
// Cost O(N n), and O(N n^2) where something is wrong: N samples of n joints.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/hypotheses/channel_faults.hpp"
#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// `pieces`: every sample, not thinned. Errors before and after are those of a window's change, over
// its rms.
[[nodiscard]] std::vector<ChannelFault> find_rate_faults(const RigidRobotModel& robot,
                                                         std::span<const Motion> pieces);

}  // namespace graybox
