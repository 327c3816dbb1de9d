// Gravity along another direction than the one that a rigid robot states: an arm on a wall or under
// a ceiling, or a base frame that stands on its side. Then no joint's weights fit, and a wrong sign
// seems to mend some of them.
//
// The force balance (wired_balance.hpp) is fitted with gravity of 9.81 m/s^2 along 26 directions,
// to faces, edges and corners of a cube. From the best it goes on by steps of 20 down to 1 degrees
// on the sphere. An axis of the base frame that does about as well stands in its place. It is
// claimed where it is 60 degrees or more from what is stated, and of the joints whose error
// changes by a fifth it brings the mean to half of what it was, and to 0.8 of a unit force. There
// it must also take 0.8 of the squares that springs at all joints would, straight and cubic. For
// what a spring carries looks like gravity that leans, by up to 50 degrees in small motion. Masses
// that are not known take part in the fit.
//
// Gains of drives that are not known are positive.
//
// Calibration: tests/diagnosis/force_balance/wiring_faults_test.cpp. Cost: some 60 fits of 600
// samples.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>

#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

struct GravityFault {
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  // m/s^2, in the base frame
  double error_before = 0.0, error_after = 0.0;       // sums over the joints, as in WiredFit
};

// None: the stated gravity does as well, or `keep_going` returned false before the end.
[[nodiscard]] std::optional<GravityFault> find_gravity_fault(
    const RigidRobotModel& robot, std::span<const Motion> pieces,
    const std::function<bool()>& keep_going = {});

}  // namespace graybox
