// The robot in the poses of a design, as lines through its joints.
//
// Forward kinematics: joint after joint, T <- T origin rotation(axis, q), with the bearings at
// rest. A pose is the origins of all joints and, last, the centre of mass of the last body.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/report/pose_picture.hpp"
#include "problems/information/information_set.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

// `degrees`: of every joint.
[[nodiscard]] std::vector<ScenePoint> robot_pose(const RobotModel& robot,
                                                 std::span<const double> degrees);

// Throws InputError unless the set's coordinates are one angle in degrees for each joint.
void require_joint_angles(const InformationSet& set, const RobotModel& robot);

// How many of these joint angles, in degrees, lie beyond the robot's limits.
[[nodiscard]] std::size_t count_beyond_limits(const RobotModel& robot,
                                              std::span<const double> degrees);

}  // namespace graybox
