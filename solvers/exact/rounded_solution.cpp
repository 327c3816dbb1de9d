#include "solvers/exact/rounded_solution.hpp"

#include <chrono>

namespace graybox {

ExactSolution solve_by_rounding(const InformationSet& set, const Relaxation& relaxation,
                                const ExactOptions& options,
                                std::vector<std::int64_t> (*round)(std::span<const double> weights,
                                                                   std::int64_t experiments)) {
  require_exact_problem(set, relaxation, options);
  const auto start = std::chrono::steady_clock::now();
  ExactSolution solution;
  solution.design.counts = round(relaxation.weights, options.experiments);
  solution.log_det_bound = relaxation.log_det_bound(options.experiments);
  solution.seconds =
      relaxation.seconds +
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  judge_exact(set, relaxation, options, solution);
  return solution;
}

}  // namespace graybox
