#include "torsney_solver.hpp"

#include <algorithm>
#include <vector>

#include "graybox/solvers/core/sensitivity.hpp"
#include "graybox/solvers/core/tracer.hpp"

graybox::Solution TorsneySolver::solve(const graybox::InformationSet& set,
                                       const graybox::SolveOptions& options,
                                       graybox::SolveObserver* observer) const {
  graybox::Tracer tracer(set, options, observer);  // clock, pass counter, limits
  const std::size_t count = set.candidate_count();
  const double d = static_cast<double>(set.dimension());
  graybox::Design design{std::vector<double>(count, 1.0 / static_cast<double>(count))};
  std::vector<double> matrix(set.packed_size()), sensitivity(count);
  graybox::InverseFactor inverse;
  for (std::int64_t iteration = 1;; ++iteration) {
    graybox::information_matrix(set, design.weights, matrix);  // M = sum_i lambda_i H_i
    if (!graybox::invert(matrix, set.dimension(), inverse)) {
      return tracer.finish(std::move(design), graybox::SolveStatus::kNumericalFailure, iteration,
                           "the information matrix became singular");
    }
    graybox::sensitivities(set, inverse.trace_dual, sensitivity);  // w_i = tr(M^-1 H_i)
    tracer.count_passes(2.0);
    const double gap = *std::ranges::max_element(sensitivity) / d - 1.0;
    tracer.record(gap, iteration);
    if (gap <= options.duality_gap) {
      return tracer.finish(std::move(design), graybox::SolveStatus::kSolved, iteration);
    }
    if (tracer.out_of_time()) {
      return tracer.finish(std::move(design), graybox::SolveStatus::kTimeLimit, iteration);
    }
    if (iteration == options.iteration_limit) {
      return tracer.finish(std::move(design), graybox::SolveStatus::kIterationLimit, iteration);
    }
    for (std::size_t i = 0; i < count; ++i) design.weights[i] *= sensitivity[i] / d;
  }
}
