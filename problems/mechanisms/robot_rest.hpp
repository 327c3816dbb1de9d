// The rest of a flexible robot under gravity and elements.
#pragma once

#include <Eigen/Core>

#include "problems/elements/element_dynamics.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

// The robot with the elements at rest: motors at the commanded joint angles, the arm where springs,
// gravity and elements balance, laws at rest.
struct RobotRest {
  Eigen::VectorXd coordinates;     // q, n_a + n_m
  Eigen::VectorXd holding_torque;  // that the motors must give, motor-side
};
// Damped Newton from the rest without elements. Throws InputError where no balance is found.
[[nodiscard]] RobotRest robot_rest(const RobotModel& robot, const ElementDynamics& elements,
                                   const Eigen::VectorXd& joint_angles);

}  // namespace graybox
