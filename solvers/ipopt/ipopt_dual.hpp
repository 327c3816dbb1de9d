// ipopt_dual: the dual of the paper, formula (10), with W = L L^T, L lower triangular:
//
//   minimise  -2 sum_j log l_jj   subject to  tr(L L^T B_i) <= d,  i = 1 .. Q,   l_jj >= 0.
//
// B_i is whitened as in ipopt_primal.hpp. Both sides are convex in L: with l_j the columns of L,
// tr(L L^T B_i) = sum_j l_j^T B_i l_j. So W needs no constraint of definiteness, and
//
//   d/dL tr(L L^T B_i) = 2 B_i L  (lower triangle),
//
// while the Hessian of the Lagrangian is one block per column of L: 2 (sum_i y_i B_i)[j.., j..],
// plus 2 / l_jj^2 from the objective. The weights are the constraint multipliers: stationarity
// reads (sum_i y_i B_i) L = L^-T, so that W^-1 = sum_i y_i B_i, and complementarity gives sum_i y_i
// = 1. p variables, Q constraints: time per iteration O(Q p^2), memory O(Q p).
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class IpoptDual final : public Solver {
 public:
  static constexpr std::string_view kName = "ipopt_dual";
  static constexpr std::string_view kDescription =
      "Ipopt on the dual, formula (10), with W = L L^T";

  [[nodiscard]] std::string_view name() const override { return kName; }
  [[nodiscard]] std::string_view description() const override { return kDescription; }
  [[nodiscard]] SolverTraits traits() const override;
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override;
};

}  // namespace graybox
