// vertex_exchange: the vertex exchange method of Boehning 1986.
//
// One iteration moves weight from the support point of smallest sensitivity, i_-, to the candidate
// of largest, i_+, by the best amount:
//
//   lambda_+ <- lambda_+ + a,   lambda_- <- lambda_- - a,   0 <= a <= lambda_-
//
// maximising log det(M + a (H_+ - H_-)), whose slope at a = 0 is w_+ - w_- >= 0. Boehning gives a
// in closed form for regression vectors; log_det_line.hpp finds it for matrices of any rank. A
// support point that should go loses its weight in one step (a = lambda_-), which is where the
// method gains on vertex directions.
//
// Cost of an iteration: one pass over the set and O(d^3).
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class VertexExchange final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "vertex_exchange"; }
  [[nodiscard]] std::string_view description() const override {
    return "weight moves from the worst support point to the best candidate";
  }
  [[nodiscard]] SolverTraits traits() const override { return {.takes_start = true}; }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
