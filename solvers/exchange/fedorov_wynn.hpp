// fedorov_wynn: the vertex direction method, with away steps.
//
//   w_+ = max over all candidates, at i_+;   w_- = min over the support, at i_-
//   if w_+ - d >= d - w_-:  lambda <- (1 - a) lambda + a e_{i_+},   0 < a <= 1
//   else                    lambda <- (1 - a) lambda + a e_{i_-},   a < 0, down to
//                                                          -lambda_-/(1 - lambda_-)
//
// Towards steps are those of Wynn 1970 and, with the best step length, Fedorov 1972; the away steps
// are Atwood's (1973), without which convergence is sublinear; with them it is linear (Ahipasaoglu,
// Sun and Todd 2008). For regression vectors the best a has a closed form; for matrices of any rank
// it is the root of a concave function's derivative, found by log_det_line.hpp.
//
// Cost of an iteration: one pass over the set and O(d^3).
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class FedorovWynn final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "fedorov_wynn"; }
  [[nodiscard]] std::string_view description() const override {
    return "vertex directions with away steps and exact line search";
  }
  [[nodiscard]] SolverTraits traits() const override { return {.takes_start = true}; }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
