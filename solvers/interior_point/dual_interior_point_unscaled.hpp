// dual_interior_point_unscaled: the paper's dual (10) exactly as written: neither whitened nor with
// its rows scaled; the method is otherwise dual_interior_point's. It is here for comparison: on
// badly scaled sets it fails where the normalised form needs a dozen iterations
// (docs/explanation/normalisation.md). It promises no gap.
//
// Statuses as for dual_interior_point, numerical_failure being the usual one on such sets.
#pragma once

#include <limits>

#include "solvers/core/solver.hpp"

namespace graybox {

class DualInteriorPointUnscaled final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "dual_interior_point_unscaled"; }
  [[nodiscard]] std::string_view description() const override {
    return "the dual (10) as written, not normalised: for comparison only, fails on badly scaled "
           "sets";
  }
  [[nodiscard]] SolverTraits traits() const override {
    return {.reachable_gap = std::numeric_limits<double>::infinity()};
  }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
