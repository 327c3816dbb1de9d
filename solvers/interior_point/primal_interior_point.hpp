// primal_interior_point: Newton's method on the paper's naive form (9) in the Q weights, with the
// dense Q x Q system through BLAS and LAPACK, honestly cubic in Q. The derivation is in
// primal_newton.hpp. Here I + U U^T (Q x Q) is formed in place by one rank-p update (dsyrk) and
// factorised in place (dpotrf). An iteration takes Q^2 p + Q^3/3 flops. The memory is 8 Q^2 bytes,
// 0.5 GB at Q = 7920.
//
// The statuses are solved, iteration_limit (default 100) and time_limit, looked at between
// iterations only. With numerical_failure comes the best design. The status is unsupported where
// the sum of all H_i is singular or the matrix does not fit into memory.
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
