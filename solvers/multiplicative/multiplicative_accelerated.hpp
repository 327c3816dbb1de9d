// multiplicative_accelerated: the multiplicative algorithm with an adaptive power, extrapolation
// and safe deletion.
//
// Extrapolation. With F(lambda)_i = lambda_i w_i/d, two plain steps from lambda give the
// logarithmic increments r_i = log(w_i/d) and r_i + v_i = log(w'_i/d), w' after the first step. The
// squared extrapolation of Varadhan and Roland 2008 (SQUAREM, their scheme S3), written in log
// lambda,
//
//   lambda_i <- lambda_i exp(2 s r_i + s^2 v_i) / total,
//   s = sqrt(sum_i lambda_i r_i^2 / sum_i lambda_i v_i^2) >= 1,
//
// is the plain double step for s = 1. While w hardly changes (v = 0) it is Torsney's power 2 s of
// w/d. The logarithm keeps weights positive and empties those off the support faster.
// The norms are those of the Fisher metric of the simplex, so that weights near zero do not steer
// s. The result is taken only if log det M is at least that of the double step (monotone); s is
// capped, and the cap grows when reached and shrinks when refused.
//
// Deletion. With each new gap the rules of screening.hpp are applied: Harman-Pronzato always, the
// Frobenius rule to its survivors each time the gap has halved. Survivors are copied together, so a
// pass soon reads a few dozen candidates instead of Q. The gap over the survivors bounds log det as
// well as the full one (the optimum is the same). Before the answer is given, one pass over all
// candidates confirms the gap, or the work goes on with a tighter target.
//
// Cost of an iteration: three passes over the survivors and O(d^3).
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class MultiplicativeAccelerated final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "multiplicative_accelerated"; }
  [[nodiscard]] std::string_view description() const override {
    return "multiplicative with extrapolation and safe deletion of candidates";
  }
  [[nodiscard]] SolverTraits traits() const override { return {.takes_start = true}; }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
