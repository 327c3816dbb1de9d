#include "solvers/core/warm_start.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "problems/base/error.hpp"
#include "solvers/core/weight_repair.hpp"

namespace graybox {

void require_start(std::span<const double> start, const InformationSet& set, const Solver& solver) {
  if (!solver.traits().takes_start) {
    throw InputError(
        fmt::format("{} can't begin from a design; leave out the start or use column_generation",
                    solver.name()));
  }
  if (start.size() != set.candidate_count()) {
    throw InputError(fmt::format("start: {} weights, but {} has {} candidates", start.size(),
                                 set.name(), set.candidate_count()));
  }
  for (std::size_t i = 0; i < start.size(); ++i) {
    if (!std::isfinite(start[i]) || start[i] < -kLargestRepair) {
      throw InputError(
          fmt::format("start: weight {} of candidate {} must be a number of at least "
                      "zero",
                      start[i], i));
    }
  }
  if (std::ranges::none_of(start, [](double weight) { return weight > 0.0; })) {
    throw InputError("start: all weights are zero; one at least must be positive");
  }
}

std::vector<double> simplex_start(std::span<const double> start) {
  std::vector<double> weights(start.begin(), start.end());
  // The largest comes first: a sum of huge weights may overflow.
  const double largest = std::ranges::max(weights);
  for (double& weight : weights) weight = std::max(0.0, weight) / largest;
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= sum;
  return weights;
}

double uniform_share(double gap) {
  return std::isfinite(gap) ? std::clamp(gap / (1.0 + gap), 0.0, 0.5) : 0.5;
}

std::string without_start(const std::string& message) {
  return fmt::format("the start was not used: its information matrix is singular{}{}",
                     message.empty() ? "" : "; ", message);
}

}  // namespace graybox
