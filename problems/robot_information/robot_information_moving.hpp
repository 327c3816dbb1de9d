// Information matrices with the linearisation point moving with theta (option total_derivative of
// robot_information.hpp).
//
// Scaling spring p moves the static equilibrium, k_i theta_i (q_i - q0_i) + g_i(q) = 0, by
//   dq*/dtheta_p = -(diag(k) + dg/dq)^-1 e_p k_p (q*_p - q0_p),
// and with it M_a and dg/dq, so that
//   dD/dtheta_p = k_p b_p b_p^T + d(dg/dq)_p - w^2 d(M_a)_p          (on the arm rotations)
//   dG_p = -j w h (S D^-1) (dD/dtheta_p) (D^-1 B)
//   H_pq = sum_w (2 Phi_r / (n_y C_v w^2)) Re tr(Y_p^H Y_q),  Y_p = dG_p (G + F^-1)^-1.
// Derivatives along dq*/dtheta_p are central differences with a step of 1e-4 rad (relative error
// about 1e-8 of a correction that is itself small). D is factored in full: O(n_f n^3) a position.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

class MovingPointWorker {
 public:
  MovingPointWorker(const RobotModel& robot, double scale);

  // Writes H, d x d packed. joint_angles in rad.
  void compute(const Eigen::VectorXd& joint_angles, double* information);

 private:
  // d(dg/dq)_p and d(M_a)_p for every parameter.
  void differentiate_arm(const LocalModel& local, const Eigen::VectorXd& commanded);
  void add_frequency(const LocalModel& local, double w, Eigen::MatrixXd& information) const;

  const RobotModel* robot_;
  double scale_;
  LocalModelBuilder builder_;
  std::vector<Eigen::MatrixXd> stiffness_change_, mass_change_;
};

}  // namespace graybox
