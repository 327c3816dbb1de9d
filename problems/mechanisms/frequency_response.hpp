// Frequency responses of a local model and of its controller, and the uncertainty of an estimated
// response. With D(w) = K + j w C - w^2 M:
//
//   G(w)      = j w h(w) S D^-1 B,   h = (1 - e^{-j w T_s}) / (j w T_s)      paper (11)
//   F(w)      = K_p (1 + (T_s/T_i) / (1 - e^{-j w T_s})), diagonal
//   Lambda    = (n_y / Phi_r) [(G + F^-1)^H (G + F^-1)]^T (x) Phi_v          paper (12)
//
// G goes from motor torque to motor velocity, both motor-side. Scale of the excitation: the
// references R of the n_u sub-experiments of one estimate satisfy R R^H = (Phi_r / n_y) I. (The
// paper's T T^H = n_y I with R = R_0 T would turn the factor n_y of (12) into 1 / n_y; this
// definition makes (12) hold as printed. It only scales the information.)
//
// The functions here factor the full matrix D and stay close to the formulas; robot_information.hpp
// computes the same quantities for many positions fast. Cost O(n^3) a frequency.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

// h(w), without cancellation at low frequencies. w in rad/s, sample_time in s.
[[nodiscard]] std::complex<double> hold_factor(double w, double sample_time);

// D(w), n x n.
[[nodiscard]] Eigen::MatrixXcd dynamic_stiffness(const LocalModel& model, double w);

// Undamped natural frequencies with the motors free, rad/s, increasing: K x = w^2 M x. Those of a
// robot at rest start with a zero for every motor that nothing holds; where gravity makes the
// position unstable, w^2 < 0 counts as zero.
[[nodiscard]] Eigen::VectorXd natural_frequencies(const LocalModel& model);

// G(w), n_y x n_u.
[[nodiscard]] Eigen::MatrixXcd frequency_response(const LocalModel& model, double w,
                                                  double sample_time);

// The derivative dG/dtheta_p at w for every parameter p of the model, linearisation point held.
// With D' = v_p b b^T (times j w for a damper), dG = -j w h v_p (S D^-1 b) (b^T D^-1 B): rank one,
// exact.
[[nodiscard]] std::vector<Eigen::MatrixXcd> frequency_response_derivatives(const LocalModel& model,
                                                                           double w,
                                                                           double sample_time);

// The diagonal of F(w).
[[nodiscard]] Eigen::VectorXcd controller_response(const PiController& controller, double w,
                                                   double sample_time);

// Phi_v(w) = C_v w^2 I: the value on the diagonal.
[[nodiscard]] double velocity_noise_psd(const RobotModel& robot, double w);

// Lambda of vec(G), columns stacked: n_y n_u x n_y n_u.
[[nodiscard]] Eigen::MatrixXcd response_covariance(const Eigen::MatrixXcd& response,
                                                   const Eigen::VectorXcd& controller,
                                                   const Eigen::MatrixXcd& noise_psd,
                                                   double reference_psd);

}  // namespace graybox
