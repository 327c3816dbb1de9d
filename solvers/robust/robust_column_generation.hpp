// robust_column_generation: robust designs (robust_problem.hpp) by column generation over the
// candidates that all samples share.
//
//   start   the mean of the D-optimal designs of a few samples alone, and of every sample for which
//           that is singular (column_generation, a millisecond each);
//   solve   both objectives on a working set of a few dozen candidates (robust_working_set.hpp),
//           which also gives multipliers pi on the samples;
//   price   w_i = sum_s pi_s tr(M_s^-1 H_{s,i}) for all candidates, one read of every sample with
//           pi_s > 0: with the spread of the phi_s, the certificate of robust_problem.hpp;
//   add     the most violating candidates, and drop those that left.
//
// The average is D-optimal design with block-diagonal matrices diag(H_{1,i}, ..., H_{N,i}) of
// dimension N d. The screening rules therefore hold for it with N d in the place of d. The gap at
// which they begin to delete is then N times smaller. With 5 to 10 passes there is nothing to gain:
// nothing is screened.
//
// Cost: a pass is N times that of one set, less the samples of price zero; memory beyond the
// samples is N times that of the working set. Statuses as for column_generation, which throws
// InputError where the matrices of a sample have a singular sum. The gap asked for is that of
// certify_robust() with the prices returned. Results do not depend on options.threads.
//
//   graybox::RobustProblem problem{{&a, &b, &c}, graybox::RobustObjective::kWorstCase};
//   problem.references = graybox::sample_optima(problem.samples, {.duality_gap = 1e-9}).log_det;
//   const auto answer = graybox::solve_robust(problem, {.duality_gap = 1e-6});
//   const auto proof = graybox::certify_robust(problem, answer.solution.design, answer.prices);
#pragma once

#include <vector>

#include "solvers/core/solver.hpp"
#include "solvers/robust/robust_problem.hpp"

namespace graybox {

struct RobustSolution {
  Solution solution;           // counters.passes: over all samples
  std::vector<double> prices;  // pi_s
};

// Throws InputError for samples that do not fit (require_shared_candidates()) and options out of
// range.
[[nodiscard]] RobustSolution solve_robust(const RobustProblem& problem, const SolveOptions& options,
                                          SolveObserver* observer = nullptr);

}  // namespace graybox
