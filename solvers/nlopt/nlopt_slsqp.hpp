// nlopt_slsqp: sequential quadratic programming (Kraft 1988, in NLopt) on the dual of the paper,
// formula (10), with W = L L^T and constraints generated in rounds.
//
// SLSQP is dense: memory O((n + m)^2) and time O(n^3 + n^2 m) an iteration for n variables and m
// constraints. On the weights n = Q, which ends at a few hundred candidates. On the dual n = p, and
// few of the Q constraints matter, so each round solves
//
//   minimise  -2 sum_j log l_jj   subject to  tr(L L^T C_i) <= d  for i in a working set,
//                                             tr(L L^T C_0) <= d,
//
// in coordinates where the best information matrix so far is the identity: M = R R^T, C_i = R^-1
// B_i R^-T with B_i the candidates whitened by their mean. C_0 = R^-1 R^-T is the mean of all
// candidates: its constraint follows from all the others and keeps the round bounded whatever the
// working set. In these coordinates L = I is the answer at the optimum and the Hessian of the
// Lagrangian there is between 2 and 4 times the identity, so that SLSQP's quasi-Newton matrix,
// which starts from the identity, has little to learn.
//
// NLopt returns no multipliers. Stationarity and complementarity determine them: z >= 0 minimises
//
//   ||I - L^T (sum_i z_i C_i) L||_F^2 / 2 + sum_i z_i (d - tr(L L^T C_i))
//
// over the working set; both terms vanish at the optimum. The weights are z_i, plus z_0 / Q for
// every candidate. A pass over the set then gives the true gap, and the 2 d candidates of the
// largest sensitivity above d join the working set.
//
// The first round starts after ten multiplicative steps. Cost: two passes a round, and the SQP
// iterations, which do not depend on Q but grow as p^3. Beyond p = 500 (d = 31), where an
// iteration takes about a tenth of a second, the status is `unsupported`. An iteration in counters
// and limits is an evaluation of the round's problem. numerical_failure where three rounds have
// not halved the gap and no candidate is left to add.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class NloptSlsqp final : public Solver {
 public:
  static constexpr std::string_view kName = "nlopt_slsqp";
  static constexpr std::string_view kDescription =
      "NLopt's SLSQP on the dual, W = L L^T, constraints generated in rounds";

  [[nodiscard]] std::string_view name() const override { return kName; }
  [[nodiscard]] std::string_view description() const override { return kDescription; }
  [[nodiscard]] SolverTraits traits() const override {
    return {.reachable_gap = 1e-9, .takes_start = true};
  }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override;
};

}  // namespace graybox
