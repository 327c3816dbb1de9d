// SmoothRestrictedProblem: optimal design under a smooth criterion (A, L, I, c, Ds, phi_p,
// compound, G and E made smooth) on a few dozen candidates by Newton's method.
//
// Mathematics. With f of criterion_frame.hpp, for a compound criterion the mean sum_k a_k f_k of
// several, minimise over lambda >= 0
//
//   psi(lambda) = f(M) + sum_i lambda_i.
//
// As f(t M) = f(M) - log t, the optimum has sum_i lambda_i = 1 of itself. The function f is convex.
// For Ds it is minus the concave log Phi of certificate.hpp. The trace tr C is a sum of terms
// 1/g_k(M), g_k > 0 concave. Each is the exponential of the convex -log g_k, and log sum exp
// preserves convexity.
//
// The gradient of psi is 1 - w_i, its second derivative S that of criterion_frame.hpp. As f(t M) =
// f(M) - log t, S lambda = w, so the model in the new weights mu is, as for D (working_set.hpp),
// minimise mu^T S mu / 2 - (2 w - 1)^T mu,  mu >= 0: nonnegative_quadratic.hpp. S is one Gram
// matrix of rows in symmetric packing for each f_k, and terms of rank one. A proximal term of 1e-7
// S_ii keeps it regular under ties and does not move the fixed points.
//
// phi_p with p > 1: p doubles from 1, and Newton's method follows the optimum.
// G, and E where it stands beside others. The sharpness of criterion_frame.hpp rises with the
// precision asked for, so that smoothing takes half of it at most. The gap handed out is that of
// the largest variance and the smallest eigenvalue, not of f. Many points, and E or G beside
// others, are smoothed by the barrier.
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
// finds no descent, multiplicative steps lambda_i <- lambda_i w_i^(1/(1 + r)) with r = 1 for traces
// and Ds and r = p for phi_p, which never increase f (multiplicative.hpp; Yu, Annals of Statistics
// 38, 2010). Cost of a step: n d^3 + n^2 p / 2 + pivots n^3 / 3.
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
  [[nodiscard]] std::span<const double> trace_dual() const override { return dual_; }
  [[nodiscard]] std::vector<double> dual_matrix() const override;   // of E in a compound
  [[nodiscard]] std::vector<double> dual_weights() const override;  // of G, part after part

 private:
  // One f_k, its share a_k, and the w_i of all members under it alone.
  struct Part {
    double share;
    CriterionKind kind;
    CriterionFrame frame;
    Eigen::MatrixXd coordinates;  // R, of E
    std::vector<double> sensitivity = {};
  };

  bool optimise(double tolerance, int step_limit);
  void sharpen(double target);
  void set_sharpness(double sharpness);
  void price_members();
  void choose_active();
  void form_hessian();
  void add_second_derivative(const Part& part, double ridge);
  void subtract_outer(double coefficient, std::span<const double> v);
  bool newton_target();
  bool search_line();
  bool multiplicative_steps(int count);
  // psi for the M that `inverse` has factorised; moves the frames there, or leaves them.
  enum class Frames { kMove, kStay };
  [[nodiscard]] double psi(const InverseCholesky& inverse, double weight_sum, Frames frames);

  std::vector<Part> parts_;
  bool complete_ = false;     // every optimum is regular
  bool is_smoothed_ = false;  // G, and E beside others
  std::vector<double> dual_;  // G of all parts, for the gap of what was smoothed
  double smoothing_ = 1.0;    // what that gap is larger than the smooth one by, at most, plus 1
  double sharpness_ = 1.0;    // of the smoothing
  double power_ = 1.0;        // p of phi_p is no larger so far
  double largest_power_ = 1.0;
  double exponent_ = 0.5;  // of multiplicative steps
  double ridge_ = 0.0;     // delta
  InverseCholesky inverse_, trial_;
  std::vector<double> matrix_, target_matrix_, trial_matrix_;  // packed M
  Eigen::MatrixXd half_, rotated_information_, unpacked_;      // of one B_i
  std::vector<double> ridge_dual_;                             // M^-1/d
  std::vector<double> sensitivity_, ridge_sensitivity_;  // w_i and tr(M^-1 H_i)/d of all members
  std::vector<std::size_t> active_;                      // with weight, or that want to enter
  std::vector<double> slope_;                            // minus the gradient of psi, active
  AlignedArray gram_rows_;
  std::vector<double> root_weight_;  // square roots of Omega in packed order
  std::vector<double> hessian_, part_hessian_, outer_sensitivity_, gram_diagonal_, curvature_;
  std::vector<double> linear_, target_, trial_weights_, regular_weights_;
  NonnegativeQuadratic quadratic_;
  double value_ = 0.0;  // psi
  double gap_ = 0.0;
};

}  // namespace graybox
