#include "problems/mechanisms/robot_dynamics.hpp"

namespace graybox {

RobotDynamics::RobotDynamics(const RobotModel& robot)
    : robot_(&robot),
      arm_(robot.arm_size()),
      motors_(robot.motor_count()),
      chain_(robot.chain),
      evaluator_(robot.chain),
      gearboxes_(robot.gearbox_rotations()),
      stiffness_(arm_),
      damping_(arm_),
      motor_mass_(robot.transmission.transpose() * robot.motor_inertia.asDiagonal() *
                  robot.transmission),
      motor_factor_(motor_mass_),
      arm_factor_(arm_),
      rotations_(arm_),
      velocities_(arm_),
      deflection_(arm_),
      deflection_rate_(arm_),
      spring_torque_(arm_),
      arm_torque_(arm_),
      motor_torque_(motors_),
      motor_side_(motors_) {
  for (Eigen::Index i = 0; i < arm_; ++i) {
    const ArmSpring& spring = robot.springs[static_cast<std::size_t>(i)];
    stiffness_(i) = spring.stiffness;
    damping_(i) = spring.damping;
  }
}

void RobotDynamics::spring_deflection(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity) {
  deflection_ = q.head(arm_);
  deflection_rate_ = velocity.head(arm_);
  for (Eigen::Index j = 0; j < motors_; ++j) {
    const Eigen::Index i = gearboxes_[static_cast<std::size_t>(j)];
    deflection_(i) -= q(arm_ + j);
    deflection_rate_(i) -= velocity(arm_ + j);
  }
}

void RobotDynamics::accelerate(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity,
                               const Eigen::VectorXd& motor_torque, const Eigen::VectorXd& force,
                               Eigen::VectorXd& acceleration) {
  spring_deflection(q, velocity);
  spring_torque_ = stiffness_.cwiseProduct(deflection_) + damping_.cwiseProduct(deflection_rate_);

  rotations_ = q.head(arm_);
  velocities_ = velocity.head(arm_);
  chain_.evaluate(rotations_, velocities_);
  arm_torque_ = force.head(arm_) - spring_torque_ - chain_.bias();
  arm_factor_.compute(chain_.mass());
  arm_factor_.solveInPlace(arm_torque_);

  motor_side_.noalias() = robot_->transmission * velocity.tail(motors_);
  motor_side_ = motor_torque - robot_->motor_friction.cwiseProduct(motor_side_);
  motor_torque_ = force.tail(motors_);
  motor_torque_.noalias() += robot_->transmission.transpose() * motor_side_;
  for (Eigen::Index j = 0; j < motors_; ++j) {
    motor_torque_(j) += spring_torque_(gearboxes_[static_cast<std::size_t>(j)]);
  }
  motor_factor_.solveInPlace(motor_torque_);
  acceleration << arm_torque_, motor_torque_;
}

void RobotDynamics::rate(const Eigen::VectorXd& state, const Eigen::VectorXd& motor_torque,
                         const Eigen::VectorXd& force, Eigen::VectorXd& rate) {
  const Eigen::Index n = degrees_of_freedom();
  Eigen::VectorXd acceleration(n);
  accelerate(state.head(n), state.tail(n), motor_torque, force, acceleration);
  rate << state.tail(n), acceleration;
}

Eigen::VectorXd RobotDynamics::motor_velocity(const Eigen::VectorXd& state) const {
  return robot_->transmission * state.tail(motors_);
}

double RobotDynamics::energy(const Eigen::VectorXd& state) {
  spring_deflection(state.head(degrees_of_freedom()), state.tail(degrees_of_freedom()));
  rotations_ = state.head(arm_);
  velocities_ = state.segment(degrees_of_freedom(), arm_);
  const auto motor_velocities = state.tail(motors_);
  const double kinetic = 0.5 * velocities_.dot(evaluator_.mass_matrix(rotations_) * velocities_) +
                         0.5 * motor_velocities.dot(motor_mass_ * motor_velocities);
  const double elastic = 0.5 * deflection_.dot(stiffness_.cwiseProduct(deflection_));
  return kinetic + elastic + evaluator_.potential_energy(rotations_);
}

double RobotDynamics::dissipated_power(const Eigen::VectorXd& state) const {
  Eigen::VectorXd rates = state.segment(degrees_of_freedom(), arm_);
  for (Eigen::Index j = 0; j < motors_; ++j) {
    rates(gearboxes_[static_cast<std::size_t>(j)]) -= state(state_size() - motors_ + j);
  }
  const Eigen::VectorXd motor_side = motor_velocity(state);
  return rates.dot(damping_.cwiseProduct(rates)) +
         motor_side.dot(robot_->motor_friction.cwiseProduct(motor_side));
}

}  // namespace graybox
