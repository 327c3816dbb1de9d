// nlopt_lbfgs, nlopt_mma, nlopt_ccsa: NLopt's first-order methods on the weights, in the one form
// that suited all three best:
//
//   minimise over u in R^Q:   f(u) = -log det(sum_i u_i^2 B_i) + d log(sum_i u_i^2),
//   lambda_i = u_i^2 / sum_j u_j^2,
//
// B_i being the candidates whitened by their mean. f does not change with the length of u, so the
// simplex needs no constraint. With M = sum_i u_i^2 B_i, s = sum_i u_i^2,
//
//   df/du_i = 2 u_i (d/s - tr(M^-1 B_i)).
//
// Stationary points with some u_i = 0 and tr(M^-1 B_i) > d/s exist, but they are saddles: the
// curvature along that u_i is negative. Starts have all u_i > 0. All local minima are global, since
// the problem in lambda is convex. Off the support the curvature at the optimum is 2 (d/s - tr(M^-1
// B_i)) > 0, so candidates leave at a linear rate. With softmax weights lambda_i ~ exp(u_i) they
// leave only as u_i -> -infinity, and L-BFGS stops before. The simplex as bounds on lambda (same
// objective, lambda in [0, 1]^Q) costs MMA and CCSA as many evaluations or up to twice as many. The
// penalty d sum lambda_i in place of the logarithm takes up to ten times as many.
//
//   nlopt_lbfgs   Nocedal's limited-memory BFGS (Luksan's code), 10 vectors
//   nlopt_mma     method of moving asymptotes (Svanberg 2002), no constraints here
//   nlopt_ccsa    the same globalisation with quadratic approximations (CCSAQ)
//
// An evaluation is two passes, O(Q p), and brings the duality gap along, which stops the run when
// it is met. These methods compare values of f, so they see differences down to about 1e-15 in f
// and gaps down to about 1e-7. A method that stops short of the asked gap, or makes no progress in
// 2000 evaluations, is started again from its best weights. This goes on as long as each start
// halves the gap; then the status is numerical_failure. Memory: O(Q), and the whitened copy of the
// set. An iteration in counters and limits is an evaluation.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class NloptLbfgs final : public Solver {
 public:
  static constexpr std::string_view kName = "nlopt_lbfgs";
  static constexpr std::string_view kDescription = "NLopt's L-BFGS on the roots of the weights";

  [[nodiscard]] std::string_view name() const override { return kName; }
  [[nodiscard]] std::string_view description() const override { return kDescription; }
  [[nodiscard]] SolverTraits traits() const override {
    return {.reachable_gap = 1e-6, .takes_start = true};
  }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override;
};

class NloptMma final : public Solver {
 public:
  static constexpr std::string_view kName = "nlopt_mma";
  static constexpr std::string_view kDescription =
      "NLopt's method of moving asymptotes on the roots of the weights";

  [[nodiscard]] std::string_view name() const override { return kName; }
  [[nodiscard]] std::string_view description() const override { return kDescription; }
  [[nodiscard]] SolverTraits traits() const override {
    return {.reachable_gap = 1e-6, .takes_start = true};
  }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override;
};

class NloptCcsa final : public Solver {
 public:
  static constexpr std::string_view kName = "nlopt_ccsa";
  static constexpr std::string_view kDescription =
      "NLopt's conservative convex separable approximation on the roots of the weights";

  [[nodiscard]] std::string_view name() const override { return kName; }
  [[nodiscard]] std::string_view description() const override { return kDescription; }
  [[nodiscard]] SolverTraits traits() const override {
    return {.reachable_gap = 1e-6, .takes_start = true};
  }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override;
};

}  // namespace graybox
