// primal_interior_point_low_rank: the Newton step of primal_interior_point, on (9) in the Q
// weights, through the p-dimensional range of its Hessian. The derivation is in primal_newton.hpp.
// The Hessian of -log det is A N A^T with A (Q x p) and N (p x p). By the Sherman-Morrison-Woodbury
// identity one p x p factor therefore replaces the Q x Q one. Linear in Q: one Hessian assembly and
// ten passes an iteration. Linear constraints on the weights beyond the simplex keep that cost:
// each adds one solve an iteration (EqualityConstraints). The dual form would have to be derived
// anew.
//
// Statuses as for primal_interior_point.
#pragma once

#include <memory>

#include "solvers/core/solver.hpp"
#include "solvers/interior_point/primal_newton.hpp"

namespace graybox {

// The system K + D^-1 by way of p x p matrices, for this and other Newton methods on the weights.
[[nodiscard]] std::unique_ptr<PrimalSystem> make_low_rank_primal_system(const NormalizedSet& normal,
                                                                        int threads);

class PrimalInteriorPointLowRank final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "primal_interior_point_low_rank"; }
  [[nodiscard]] std::string_view description() const override {
    return "the Newton step of primal_interior_point by way of p x p matrices: linear in Q";
  }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
