// primal_interior_point: Newton's method on the paper's naive form (9) in the Q weights, with the
// dense Q x Q system through BLAS and LAPACK, honestly cubic in Q. The derivation is in
// primal_newton.hpp; here I + U U^T (Q x Q) is formed in place by one rank-p update (dsyrk) and
// factorised in place (dpotrf): Q^2 p + Q^3/3 flops an iteration, 8 Q^2 bytes, 0.5 GB at Q = 7920.
//
// Statuses: solved; iteration_limit (default 100); time_limit, looked at between iterations only;
// numerical_failure with the best design; unsupported where the sum of all H_i is singular or the
// matrix does not fit into memory.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class PrimalInteriorPoint final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "primal_interior_point"; }
  [[nodiscard]] std::string_view description() const override {
    return "Newton on (9) with the dense Q x Q system: cubic in Q, 8 Q^2 bytes";
  }
  [[nodiscard]] SolverTraits traits() const override { return {.memory_exponent = 2}; }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
