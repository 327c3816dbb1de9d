// EigenvalueRestrictedProblem: E-optimal design on a few dozen candidates as a semidefinite program,
// by a primal-dual interior point.
//
// Mathematics. With C = R R^T (the identity, in the parameters' own coordinates)
//
//   maximise t    subject to  Z = sum_i lambda_i H_i - t C >= 0,  sum_i lambda_i = 1,  lambda >= 0;
//   minimise nu   subject to  s_i = nu - tr(E H_i) >= 0,  tr(E C) = 1,  E >= 0.
//
// t <= lambda_min(M) and nu = max_i tr(E H_i) bounds it from above for every design (certificate
// .hpp); nu - t = sum_i lambda_i s_i + tr(E Z). Newton's method on lambda_i s_i = mu, E Z = mu I, the
// latter in the scaling of Nesterov and Todd 1997: g with g^-1 E g^-T = g^T Z g = diag(v) and, in
// scaled steps dE~ = g^-1 dE g^-T, dZ~ = g^T dZ g,
//
//   dE~ + dZ~ = diag(mu/v - v).
//
// With B_i = g^T H_i g, K_ij = tr(B_i B_j), c~ = g^T C g, k_i = tr(c~ B_i), elimination leaves
//
//   [ K + S/Lambda   -k         1 ] [ dlambda ]   [ mu/lambda_i - s_i + tr(diag(mu/v - v) B_i) ]
//   [ k^T         -tr(c~ c~)    0 ] [ dt      ] = [ tr(diag(mu/v - v) c~)                      ]
//   [ 1^T            0          0 ] [ dnu     ]   [ 0                                          ]
//
// Predictor and corrector as in Mehrotra 1992; the start is feasible and all equations but the
// complementarity hold from then on: 10 to 20 iterations. Cost of an iteration: n d^3 + n^2 p / 2 +
// n^3. Weights that complementarity shows to vanish are set to zero at the end.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "graybox/problems/aligned_array.hpp"
#include "graybox/solvers/restricted_problem.hpp"

namespace graybox {

class EigenvalueRestrictedProblem final : public RestrictedProblem {
 public:
  // R, d x d row-major; the identity if empty.
  EigenvalueRestrictedProblem(std::size_t dimension, std::span<const double> coordinates);

  bool improve(double pool_gap, double tolerance) override;
  // G is the last E over the lambda_min(M) of the present weights, before the first solve the
  // eigenvector's.
  [[nodiscard]] bool refresh() override;
  [[nodiscard]] std::span<const double> trace_dual() const override { return dual_; }
  [[nodiscard]] std::vector<double> dual_matrix() const override;

 private:
  using MatrixXd = Eigen::MatrixXd;
  using VectorXd = Eigen::VectorXd;

  bool start();
  bool solve(double tolerance);
  bool scale();
  void form_system();
  void solve_direction(double mu, bool second_order);
  [[nodiscard]] double steps(double& primal, double& dual) const;
  void update_residuals();
  void finish_weights();

  MatrixXd coordinates_, c_;
  std::vector<double> packed_;
  std::vector<double> dual_;
  MatrixXd e_;  // E
  double t_ = 0.0, nu_ = 0.0;
  VectorXd lambda_, s_;
  MatrixXd z_;                                         // Z
  MatrixXd g_, scaled_c_;                              // g, c~
  VectorXd v_;                                         //
  std::vector<MatrixXd> scaled_information_;           // B_i
  AlignedArray gram_rows_;                             //
  std::vector<double> gram_;                           // K
  MatrixXd system_;                                    //
  VectorXd lambda_step_, s_step_;                      //
  MatrixXd scaled_e_step_, scaled_z_step_, unpacked_;  //
  double t_step_ = 0.0, nu_step_ = 0.0;
};

}  // namespace graybox
