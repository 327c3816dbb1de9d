// The non-linear robot: rigid arm on springs and dampers, one motor behind each gearbox (paper,
// Section VI-A),
//
//   M_a(q_a) q_a'' + c(q_a, q_a') + g(q_a) = -tau_s + f_a
//   N^T J N q_m'' = N^T (u - d_m N q_m') + (gearbox torques) + f_m
//
// The coordinates q_a are the n_a arm rotations (bearings and gearboxes in chain order). The
// coordinates q_m are the n_m motors counted in joint angles (motor-side angle = N q_m). The
// springs and dampers give tau_s = k (q_a - q_0) + d (q_a' - q_0'), with q_0 = 0 at a bearing and
// the motor's coordinate at a gearbox. The inputs u are the motor torques, motor side. Further
// generalised forces f, such as missing physics, do work on (q_a, q_m). Linearised about rest this
// is the LocalModel at the same place.
//
// The state is (q_a, q_m, q_a', q_m'), 36 numbers for the paper's robot.
//
//   RobotDynamics dynamics(robot);                              // one for each thread
//   const RobotRest rest = robot_rest(robot, {}, position);     // robot_rest.hpp
//   dynamics.accelerate(rest.coordinates, zero, rest.holding_torque, zero, acceleration);   // = 0
//
// Cost of accelerate(): O(n_a^3), a few microseconds for the paper's robot; no allocation.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "problems/mechanisms/chain_dynamics.hpp"
#include "problems/mechanisms/rigid_chain.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

class RobotDynamics {
 public:
  // Keeps a reference to the robot.
  explicit RobotDynamics(const RobotModel& robot);

  [[nodiscard]] Eigen::Index degrees_of_freedom() const { return arm_ + motors_; }
  [[nodiscard]] Eigen::Index state_size() const { return 2 * degrees_of_freedom(); }

  // (q_a'', q_m''). `q`, `velocity`, `force` (f of the equations): n_a + n_m; `motor_torque`: n_m,
  // motor side.
  void accelerate(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity,
                  const Eigen::VectorXd& motor_torque, const Eigen::VectorXd& force,
                  Eigen::VectorXd& acceleration);
  // d(state)/dt, from the same.
  void rate(const Eigen::VectorXd& state, const Eigen::VectorXd& motor_torque,
            const Eigen::VectorXd& force, Eigen::VectorXd& rate);

  // Motor-side motor velocities N q_m', what the robot measures.
  [[nodiscard]] Eigen::VectorXd motor_velocity(const Eigen::VectorXd& state) const;

  // Kinetic, elastic and gravitational energy, J. It changes by the work of motors and forces less
  // what dampers and motor friction take.
  [[nodiscard]] double energy(const Eigen::VectorXd& state);
  [[nodiscard]] double dissipated_power(const Eigen::VectorXd& state) const;  // W, >= 0

 private:
  void spring_deflection(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity);

  const RobotModel* robot_;
  Eigen::Index arm_;
  Eigen::Index motors_;
  ChainDynamics chain_;
  RigidChainEvaluator evaluator_;
  std::vector<Eigen::Index> gearboxes_;
  Eigen::VectorXd stiffness_, damping_;  // n_a
  Eigen::MatrixXd motor_mass_;           // N^T J N
  Eigen::LLT<Eigen::MatrixXd> motor_factor_;
  Eigen::LLT<Eigen::MatrixXd> arm_factor_;
  // Scratch of rate(): rotations, their velocities, deflections and their rates, torques.
  Eigen::VectorXd rotations_, velocities_, deflection_, deflection_rate_, spring_torque_;
  Eigen::VectorXd arm_torque_, motor_torque_, motor_side_;
};

}  // namespace graybox
