// ConstitutiveResiduals: how far the springs' law must be violated to explain a measured response
// of the robot; the misfit with which a fit starts far from the truth (constitutive_stage.hpp).
//
// The error in the constitutive relation (Ladeveze; Banerjee, Walsh, Aquino and Bonnet 2013 for
// frequency responses). Balance of forces is taken as exact, while spring p may pull with theta_p
// k_p e_p - q_p for its elongation e_p. Let D(theta) = K + j w C - w^2 M, A = j w h B^T D^-1 [b_1
// ... b_P] and E = G_hat - G(theta). A column c of E U is explained by noise and forces, A q +
// noise, at the cost
//
//   min over q:  |q|^2_{Q^-1} + |E U - A q|^2_{Lambda_c^-1} = e^H (Lambda_c + A Q A^H)^-1 e,
//   Q = tau^2 T_c diag(theta_p k_p),     Lambda_c = (2 m left^H left)^-1,
//
// per column, e = (E U)_c: Q^-1 measures the violation as energy in the springs, relative to the
// motors' energy T_c = sum_i J_i |(G_hat U)_ic|^2. Near a resonance of the *model* A is large and
// the error counts little: unlike |E|, the misfit has no narrow valleys, and tau -> 0 gives the
// likelihood (7).
//
// Derivatives. Balanced fields (e_p, forces) do not depend on theta, so at the minimising q
//
//   d/d log theta_p = 2 Re e^H W A_p (theta_p k_p e^_p - q_p / 2),    e^ = b^T D^-1 (B U + [b] q),
//
// W = (Lambda_c + A Q A^H)^-1. Take residuals r = L^-1 e, L L^H = W^-1, and the columns L^-1 A_p
// (theta_p k_p e^_p - q_p / 2) as derivatives. Then the gradient J^T r is exact. The matrix J
// itself is Gauss and Newton's up to terms that vanish with r.
//
// Cost: one solution with the matrix D, and n_u Cholesky factors of n_y x n_y, for each line.
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <vector>

#include "diagnosis/response_fits/response_measurement.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

class ConstitutiveResiduals : public ceres::CostFunction {
 public:
  // Linearised at the measurement's position for this theta; `relaxation` is tau. Where the
  // measurement has no noise of its own, it is that of (12) for the measured response. Copies what
  // it needs. Throws InputError where there is no operating point.
  ConstitutiveResiduals(const RobotModel& robot, const ResponseMeasurement& measurement,
                        const Eigen::VectorXd& theta, double relaxation);

  // parameters[0] is log theta. Real and imaginary parts of r, column by column and line by line.
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  struct Line {
    double frequency = 0.0;
    Eigen::MatrixXcd response;    // G_hat
    Eigen::MatrixXcd excitation;  // U
    Eigen::MatrixXcd covariance;  // Lambda_c
    Eigen::VectorXd energy;       // tau^2 T_c
  };

  void solve(const Line& line) const;
  void relax(const Line& line, Eigen::Index column) const;
  void differentiate(const Line& line, Eigen::Index column) const;

  LocalModel model_;
  double sample_time_;
  std::vector<Line> lines_;
  Eigen::MatrixXd springs_;  // b_p in columns
  Eigen::VectorXd base_theta_;
  Eigen::VectorXd nominal_;   // k_p: stiffness for theta_p = 1
  Eigen::MatrixXcd sources_;  // [B, b_1 ... b_P]
  // What one evaluation needs.
  mutable Eigen::VectorXd spring_stiffness_;
  mutable Eigen::MatrixXd stiffness_;
  mutable Eigen::MatrixXcd dynamic_, states_, error_, elongations_, transfer_, covariance_;
  mutable Eigen::MatrixXcd derivatives_;
  mutable Eigen::VectorXcd residual_, force_, elongation_;
  mutable Eigen::PartialPivLU<Eigen::MatrixXcd> dynamic_factor_;
  mutable Eigen::LLT<Eigen::MatrixXcd> factor_;
};

}  // namespace graybox
