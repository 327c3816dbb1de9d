// multiplicative: the classical multiplicative algorithm, in its plain form (Titterington 1976;
// Silvey, Titterington and Torsney 1978),
//
//   lambda_i <- lambda_i w_i / d,     w_i = tr(M^-1 H_i),
//
// from uniform weights. It is an EM algorithm: log det M never falls, for matrices of any rank (Yu
// 2010), and the weights stay on the simplex by themselves since sum_i lambda_i w_i = d. Close to
// the optimum weights off the support shrink by the factor w_i/d < 1 an iteration, which is slow
// where w_i is nearly d: thousands of passes on smooth candidate sets. It is here as the baseline.
//
// Weights stop shrinking at kSmallestWeight (kernels.hpp). From the answer those are taken off
// whose share lambda_i H_i of M is below 1e-17 of it.
//
// Cost of an iteration: one pass (pricing, step and new M in a single read) and O(d^3).
#pragma once

#include "graybox/solvers/solver.hpp"

namespace graybox {

class Multiplicative final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "multiplicative"; }
  [[nodiscard]] std::string_view description() const override {
    return "weights times w/d, the classical baseline in its plain form";
  }
  [[nodiscard]] SolverTraits traits() const override { return {.reachable_gap = 1e-6}; }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
