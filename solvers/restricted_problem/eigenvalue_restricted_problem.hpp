// EigenvalueRestrictedProblem: E-optimal design on a few dozen candidates as a semidefinite
// program, by a primal-dual interior point.
//
// Mathematics. With C = R R^T (the identity, in the parameters' own coordinates)
//
//   maximise t    subject to  Z = sum_i lambda_i H_i - t C >= 0,  sum_i lambda_i = 1,  lambda >= 0;
//   minimise nu   subject to  s_i = nu - tr(E H_i) >= 0,  tr(E C) = 1,  E >= 0.
//
// t <= lambda_min(M) and nu = max_i tr(E H_i) bounds it from above for every design (certificate
// .hpp); nu - t = sum_i lambda_i s_i + tr(E Z). Newton's method is applied to lambda_i s_i = mu, E
// Z = mu I, the latter in the scaling of Nesterov and Todd 1997. That is a g with g^-1 E g^-T = g^T
// Z g = diag(v) and, in scaled steps dE~ = g^-1 dE g^-T, dZ~ = g^T dZ g,
//
//   dE~ + dZ~ = diag(mu/v - v).
//
// With B_i = g^T H_i g, K_ij = tr(B_i B_j), c~ = g^T C g and F for the right side above,
// elimination of dE, ds and dZ leaves, for c_i the right side of lambda_i ds_i + s_i dlambda_i =
// c_i,
//
//   (K + S/Lambda) dlambda - k dt + 1 dnu = c_i/lambda_i + tr(F B_i) =: b,     k_i = tr(c~ B_i),
//   k^T dlambda - tr(c~ c~) dt = tr(F c~),       1^T dlambda = 0,
//
// where k and c~ grow as 1/mu and cancel. Since sum_i lambda_i B_i = t c~ + diag(v) and
// tr(diag(v) B_i) = tr(E H_i) = nu - s_i, the unknowns x = dlambda - lambda dt/t and
// y = dnu + nu dt/t turn it into
//
//   [ K + S/Lambda       1       ] [ x ]   [ b            ]
//   [     1^T       1/(nu + t)   ] [ y ] = [ gamma/(nu+t) ],    dt/t = -1^T x,
//
//   gamma = sum_i c_i + tr(F diag(v)),           dZ~ = sum_i x_i B_i + (dt/t) diag(v):
//
// one definite matrix of order n, and nothing that cancels.
//
// Predictor and corrector as in Mehrotra 1992; the start is feasible and all equations but the
// complementarity hold from then on: 10 to 20 iterations.
//
// Rounding. Where the optimal weights are not unique, as among near-duplicates, S/Lambda vanishes
// on directions in which K is singular. With A the matrix of rows svec(B_i) (entries off the
// diagonal times sqrt(2)), K = A A^T and both right sides are in the range of [A,
// (S/Lambda)^(1/2)],
//
//   b = A svec(F) + (S/Lambda)^(1/2) c/(lambda s)^(1/2),
//   1 = (A svec(diag(v)) + (S/Lambda)^(1/2) (lambda s)^(1/2))/nu,
//
// so that the steps are those of a damped least-squares problem (damped_least_squares.hpp). It is
// solved by normal equations down to a gap of 1e-6. Below, an orthogonal factorisation is used,
// which bears the square of their condition. The step ds comes from ds_i = dnu - tr(dE~ B_i). An
// error of the solution then disturbs the complementarity, not the feasibility of the dual, and the
// gap stays a proven one.
//
// Cost of an iteration: n d^3 + n^2 p / 2 + n^3 / 6, the orthogonal one n^2 (p + 2 n/3) more. The
// smallest weights are taken off at the end, as far as the tolerance allows.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <span>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "solvers/restricted_problem/damped_least_squares.hpp"
#include "solvers/restricted_problem/restricted_problem.hpp"

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

  // Of C = R R^T relative to the information matrix of the weights; false if that is singular.
  [[nodiscard]] bool compute_spectrum(std::span<const double> weights);
  [[nodiscard]] double smallest_eigenvalue() const;  // lambda_min at the last compute_spectrum()
  [[nodiscard]] bool start();
  void price();
  void update_residuals();
  [[nodiscard]] bool scale();
  void to_vector(const MatrixXd& symmetric, VectorXd& vector) const;
  void to_matrix(const VectorXd& vector, MatrixXd& symmetric);
  [[nodiscard]] bool form_system(DampedLeastSquares::Method method);
  void solve_direction(double mu, bool second_order);
  [[nodiscard]] double steps(double& primal, double& dual) const;
  [[nodiscard]] bool iterate(DampedLeastSquares::Method method);
  double solve(double tolerance);
  void finish_weights(double share);

  MatrixXd coordinates_, c_;
  VectorXd symmetric_scale_;
  std::vector<double> packed_, dual_;
  Eigen::LLT<MatrixXd> cholesky_;
  Eigen::SelfAdjointEigenSolver<MatrixXd> spectrum_;
  MatrixXd unpacked_, product_;

  VectorXd lambda_, s_;
  MatrixXd e_, z_;  // E, Z
  double t_ = 0.0, nu_ = 0.0;

  MatrixXd g_;
  VectorXd v_, scaled_v_;     // v and svec(diag(v))
  AlignedArray scaled_rows_;  // A
  std::size_t stride_ = 0;
  DampedLeastSquares system_;
  VectorXd inverse_ones_;  // (K + S/Lambda)^-1 1

  MatrixXd residual_;  // F
  VectorXd scaled_row_, scaled_residual_, target_, x_;
  VectorXd lambda_step_, s_step_;
  MatrixXd scaled_e_step_, scaled_z_step_;
  double t_step_ = 0.0, nu_step_ = 0.0;
};

}  // namespace graybox
