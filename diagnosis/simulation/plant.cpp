#include "diagnosis/simulation/plant.hpp"

#include <fmt/format.h>

#include "diagnosis/simulation/exact_plant.hpp"
#include "diagnosis/simulation/integrated_plant.hpp"
#include "diagnosis/simulation/mechanism.hpp"
#include "problems/base/error.hpp"
#include "problems/mechanisms/robot_rest.hpp"

namespace graybox {
namespace {

// The force of the elements at rest at q.
Eigen::VectorXd static_force(const ElementDynamics& elements, const Eigen::VectorXd& q) {
  Eigen::VectorXd force = Eigen::VectorXd::Zero(q.size());
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(q.size(), q.size());
  elements.add_static_force(q, force, slope);
  return force;
}

// A sampled plant is driven by forces and measured in positions and velocities.
void require_simulable(const LumpedModel& model) {
  if (!model.is_driven_by_forces_alone()) {
    throw InputError(
        fmt::format("{}: inputs: a simulated plant is driven by forces alone, but a motion is "
                    "imposed or a law driven by a recorded signal",
                    model.name));
  }
  for (std::size_t j = 0; j < model.outputs.size(); ++j) {
    using enum LumpedOutput::Quantity;
    const auto quantity = model.outputs[j].quantity;
    if (quantity == kPosition || quantity == kVelocity) continue;
    throw InputError(
        fmt::format("{}: outputs: a simulated plant measures position and velocity, but '{}' is "
                    "another quantity",
                    model.name, model.output_names[j]));
  }
}

}  // namespace

std::unique_ptr<Plant> local_plant(const LocalModel& model, double sample_time) {
  return exact_plant(linear_motion(model), sample_time);
}

std::unique_ptr<Plant> local_robot_plant(const RobotModel& robot,
                                         const std::vector<Element>& elements,
                                         const Eigen::VectorXd& joint_angles,
                                         const IntegratorOptions& options) {
  const ElementDynamics dynamics(elements, robot.motor_count(), robot.motor_count());
  LocalModelBuilder builder(robot);
  if (dynamics.empty()) return local_plant(builder.build(joint_angles), robot.sample_time);
  const RobotRest rest = robot_rest(robot, dynamics, joint_angles);
  LinearMotion motion =
      linear_motion(builder.build_at(rest.coordinates.head(robot.arm_size()), joint_angles));
  motion.rest_input = rest.holding_torque;
  motion.rest_force = static_force(dynamics, rest.coordinates);
  return integrated_plant(linear_mechanism(motion), dynamics,
                          {rest.coordinates, dynamics.command_for(rest.holding_torque)},
                          robot.sample_time, options);
}

std::unique_ptr<Plant> robot_plant(const RobotModel& robot, const std::vector<Element>& elements,
                                   const Eigen::VectorXd& joint_angles,
                                   const IntegratorOptions& options) {
  const ElementDynamics dynamics(elements, robot.motor_count(), robot.motor_count());
  const RobotRest rest = robot_rest(robot, dynamics, joint_angles);
  return integrated_plant(robot_mechanism(robot), dynamics,
                          {rest.coordinates, dynamics.command_for(rest.holding_torque)},
                          robot.sample_time, options);
}

std::unique_ptr<Plant> lumped_plant(const LumpedModel& model, const IntegratorOptions& options) {
  require_simulable(model);
  const Eigen::Index n = model.mass.rows(), inputs = model.input.cols();
  const LinearMotion motion{model.mass,
                            model.damping,
                            model.stiffness,
                            model.input,
                            model.position_output,
                            model.velocity_output,
                            Eigen::VectorXd::Zero(n),
                            Eigen::VectorXd::Zero(inputs),
                            Eigen::VectorXd::Zero(n)};
  ElementDynamics dynamics(model.elements, inputs, model.velocity_output.rows());
  if (dynamics.empty()) return exact_plant(motion, model.sample_time);
  return integrated_plant(linear_mechanism(motion), std::move(dynamics),
                          {motion.rest, motion.rest_input}, model.sample_time, options);
}

}  // namespace graybox
