#include "solvers/exact/rounding.hpp"

#include <algorithm>
#include <cmath>

#include "solvers/exact/rounded_solution.hpp"

namespace graybox {

std::vector<std::int64_t> round_weights(std::span<const double> weights, std::int64_t experiments) {
  const auto m = static_cast<double>(experiments);
  std::vector<std::int64_t> counts(weights.size());
  std::vector<double> excess(weights.size());
  std::int64_t total = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    counts[i] = std::llround(m * weights[i]);
    excess[i] = static_cast<double>(counts[i]) - m * weights[i];
    total += counts[i];
  }
  while (total != experiments) {
    const auto at =
        total > experiments ? std::ranges::max_element(excess) : std::ranges::min_element(excess);
    const std::int64_t change = total > experiments ? -1 : 1;
    counts[static_cast<std::size_t>(at - excess.begin())] += change;
    *at += static_cast<double>(change);
    total += change;
  }
  return counts;
}

ExactSolution Rounding::solve(const InformationSet& set, const Relaxation& relaxation,
                              const ExactOptions& options, ExactObserver* /*observer*/) const {
  return solve_by_rounding(set, relaxation, options, &round_weights);
}

}  // namespace graybox
