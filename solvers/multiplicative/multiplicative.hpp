// multiplicative: the classical multiplicative algorithm, in its plain form (Titterington 1976;
// Silvey, Titterington and Torsney 1978),
//
//   lambda_i <- lambda_i w_i / d,     w_i = tr(M^-1 H_i),
//
// from uniform weights. It is an EM algorithm: log det M never falls, for matrices of any rank (Yu
// 2010), and the weights stay on the simplex by themselves since sum_i lambda_i w_i = d. Close to
// the optimum weights off the support shrink by the factor w_i/d < 1 an iteration, which is slow
// where w_i is nearly d: thousands of passes on smooth candidate sets. It is here as the baseline.
//
// Criteria A, L and Ds take the exponent 1/2: with w_i and phi of certificate.hpp,
//
//   lambda_i <- lambda_i sqrt(w_i) / sum_j lambda_j sqrt(w_j).
//
// It never makes the criterion worse, for matrices of any rank (for rank one and A: Torsney 1983;
// see Yu 2010). Write H_i = F_i F_i^T. By Gauss and Markov
//
//   K^T M^-1 K = min { sum_i Y_i^T Y_i / lambda_i : sum_i F_i Y_i = K }   (Loewner order),
//
// attained at Y_i = lambda_i F_i^T M^-1 K. So tr C <= sum_i |Y_i|^2 / lambda_i' for any lambda',
// with equality at lambda' = lambda; the right side is least at lambda_i' ~ |Y_i| = lambda_i
// sqrt(w_i). For Ds, log det C' <= log det C + tr(C^-1 C') - s and the same with Y_i C^(-1/2) for
// Y_i. The exponent 1 of D is not safe here: with two candidates (1, 1) and (1, -1) and the first
// parameter of interest for c = (1, 0), C = (1/lambda_1 + 1/lambda_2)/4 and the step swaps the two
// weights for ever.
//
// Weights stop shrinking at kSmallestWeight (kernels.hpp). From the answer those are taken off
// whose share lambda_i H_i of M is below 1e-17 of it.
//
// Cost of an iteration: one pass (pricing, step and new M in a single read) and O(d^3).
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class Multiplicative final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "multiplicative"; }
  [[nodiscard]] std::string_view description() const override {
    return "weights times w/d, the classical baseline in its plain form";
  }
  [[nodiscard]] SolverTraits traits() const override {
    return {.reachable_gap = 1e-6,
            .takes_start = true,
            .criteria = {CriterionKind::kD, CriterionKind::kA, CriterionKind::kL,
                         CriterionKind::kDs, CriterionKind::kC, CriterionKind::kI}};
  }
  // Throws InputError for criterion E.
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
