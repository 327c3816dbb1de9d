// dual_interior_point: the paper's dualised form (10) in the p = d(d+1)/2 entries of W, by a
// primal-dual interior-point method with a dense p x p Newton matrix. The derivation is in
// dual_newton.hpp. Linear in Q: one Hessian assembly (hessian_assembly.hpp) and six passes an
// iteration, 8 to 20 iterations whatever the family of problems. Threads share the assembly.
//
// Statuses: solved; iteration_limit (default 100); time_limit; numerical_failure with the best
// design where 15 iterations bring no progress or a factorisation breaks down; unsupported where
// the sum of all H_i is singular.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class DualInteriorPoint final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "dual_interior_point"; }
  [[nodiscard]] std::string_view description() const override {
    return "interior point on the dual (10), p x p dense Newton matrix: linear in Q";
  }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
