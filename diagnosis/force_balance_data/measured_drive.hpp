// A drive of one mass (graybox-lumped/1) of which the force and the motion are measured, as a rigid
// robot of one joint. Its physics can then be looked for in the balance of forces.
//
//   m q'' + elements + what is missing = u
//
// Which of the two methods sees more depends on the drive. Where friction takes nearly all of the
// force, the best forecast of a short motion is constant velocity, whatever the force does: a
// prediction says nothing about it, the balance says all. Where the motion is noisy, it is the
// other way round: a balance needs accelerations.
#pragma once

#include <optional>

#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// Massless but for the rotor, which is the drive's mass, known where it is fixed. None of a model
// with several masses or inputs, imposed motion, laws of actuators or sensors, several outputs of
// one kind, or elements with parameters in which the force is not linear.
[[nodiscard]] std::optional<RigidRobotModel> measured_drive(const LumpedModel& model);

}  // namespace graybox
