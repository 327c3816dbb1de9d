#include "solvers/exact/efficient_rounding.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "solvers/exact/rounded_solution.hpp"

namespace graybox {

std::vector<std::int64_t> round_weights_efficiently(std::span<const double> weights,
                                                    std::int64_t experiments) {
  std::vector<std::size_t> support;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] > 0.0) support.push_back(i);
  }
  const double multiplier =
      static_cast<double>(experiments) - 0.5 * static_cast<double>(support.size());
  std::vector<std::int64_t> counts(weights.size(), 0);
  std::int64_t total = 0;
  for (const std::size_t i : support) {
    counts[i] = std::max<std::int64_t>(1, std::llround(std::ceil(multiplier * weights[i])));
    total += counts[i];
  }
  for (; total < experiments; ++total) {
    ++counts[*std::ranges::min_element(
        support, {}, [&](std::size_t i) { return static_cast<double>(counts[i]) / weights[i]; })];
  }
  for (; total > experiments; --total) {
    // Counts already at zero have nothing to give; among single runs the lightest goes first.
    --counts[*std::ranges::max_element(support, {}, [&](std::size_t i) {
      return counts[i] == 0
                 ? std::pair{-1.0, 0.0}
                 : std::pair{static_cast<double>(counts[i] - 1) / weights[i], -weights[i]};
    })];
  }
  return counts;
}

ExactSolution EfficientRounding::solve(const InformationSet& set, const Relaxation& relaxation,
                                       const ExactOptions& options,
                                       ExactObserver* /*observer*/) const {
  return solve_by_rounding(set, relaxation, options, &round_weights_efficiently);
}

}  // namespace graybox
