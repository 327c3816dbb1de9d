// SmoothRestrictedProblem: A-, L- and Ds-optimal design on a few dozen candidates by Newton's
// method.
//
// Mathematics. With f of criterion_frame.hpp, minimise over lambda >= 0
//
//   psi(lambda) = f(M) + sum_i lambda_i.
//
// As f(t M) = f(M) - log t, the optimum has sum_i lambda_i = 1 of itself. The function f is convex.
// For Ds it is minus the concave log Phi of certificate.hpp. The trace tr C is a sum of terms
// 1/g_k(M), g_k > 0 concave. Each is the exponential of the convex -log g_k, and log sum exp
// preserves convexity.
//
// In the frame X^, D of criterion_frame.hpp and with B_i = X^ H_i X^^T, w_i = tr(G H_i) = sum_a D_a
// (B_i)_aa and
//
//   gradient  1 - w_i,    Hessian  S_ij = sum_ab Omega_ab (B_i)_ab (B_j)_ab   [- w_i w_j for A, L],
//
//   A, L   Omega_ab = D_a + D_b: the second derivative of tr C is 2 tr(M^-1 K K^T M^-1 H_i M^-1
//          H_j);
//   Ds     Omega_ab = max(D_a, D_b): tr(B_i B_j)/s, less the same for the block of B beside the
//          range of P, whose determinant is what log det M has more than log det C^-1.
//
// S lambda = w, since sum_i lambda_i B_i = I, so the model in the new weights mu is, as for D
// (working_set.hpp),  minimise mu^T S mu / 2 - (2 w - 1)^T mu,  mu >= 0: nonnegative_quadratic.hpp.
// S is one Gram matrix of rows in symmetric packing; a proximal term of 1e-7 S_ii keeps it regular
// under ties and does not move the fixed points.
//
// Singular optima. Where K has fewer columns than d (c-optimality, a singular W, Ds) the optimal M
// may be singular, and then neither it nor its neighbours along an arbitrary path have a small gap.
// Add delta times the D-criterion: psi_delta = f - (delta/d) log det M + (1 + delta) sum lambda.
// Its optimum is regular and has tr(G H_i) + (delta/d) tr(M^-1 H_i) <= 1 + delta for all i, hence
//
//   gap = max_i tr(G H_i) - 1 <= delta:                                                       (a)
//
// a regular design of any gap exists, and the bound of the ridge that finds it is known beforehand.
// delta is half of the gap to be reached, and zero where K has d columns. From (a), tr(M^-1 H_i) <=
// d (1 + delta)/delta for every i, hence M >= U delta/(d (1 + delta)) for any design's U: the
// condition of M grows only as 1/delta.
//
// The line is searched by Armijo's rule, down to changes at rounding level. Where Newton's step
// finds no descent, multiplicative steps lambda_i <- lambda_i sqrt(w_i), which never increase f
// (multiplicative.hpp). Cost of a step: n d^3 + n^2 p / 2 + pivots n^3 / 3.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/restricted_problem/criterion_frame.hpp"
#include "solvers/restricted_problem/nonnegative_quadratic.hpp"
#include "solvers/restricted_problem/restricted_problem.hpp"

namespace graybox {

class SmoothRestrictedProblem final : public RestrictedProblem {
 public:
  // As CriterionFrame.
  SmoothRestrictedProblem(const Criterion& criterion, std::size_t dimension,
                          std::span<const double> coordinates);

  bool improve(double pool_gap, double tolerance) override;
  [[nodiscard]] bool refresh() override;
  [[nodiscard]] std::span<const double> trace_dual() const override { return frame_.trace_dual(); }

 private:
  bool optimise(double tolerance, int step_limit);
  void price_members();
  void choose_active();
  void form_hessian();
  bool newton_target();
  bool search_line();
  bool multiplicative_steps(int count);
  // psi, given f, for the M that `inverse` has factorised.
  [[nodiscard]] double psi(double f, const InverseCholesky& inverse, double weight_sum) const;

  CriterionFrame frame_;
  double ridge_ = 0.0;  // delta
  InverseCholesky inverse_, trial_;
  std::vector<double> matrix_, target_matrix_, trial_matrix_;  // packed M
  Eigen::MatrixXd half_, rotated_information_, unpacked_;      // of one B_i
  std::vector<double> ridge_dual_;                             // M^-1/d
  std::vector<double> sensitivity_, ridge_sensitivity_;  // w_i and tr(M^-1 H_i)/d of all members
  std::vector<std::size_t> active_;                      // with weight, or that want to enter
  std::vector<double> slope_;                            // minus the gradient of psi, active
  AlignedArray gram_rows_;
  std::vector<double> root_weight_;  // square roots of Omega in packed order
  std::vector<double> hessian_, linear_, target_, trial_weights_, regular_weights_;
  NonnegativeQuadratic quadratic_;
  double value_ = 0.0;  // psi
  double gap_ = 0.0;
};

}  // namespace graybox
