#include "solvers/core/weight_repair.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace graybox {

std::optional<WeightRepair> repair_weights(std::vector<double>& weights) {
  const auto sum_of = [&] { return std::accumulate(weights.begin(), weights.end(), 0.0); };
  const auto is_near = [](double weight) { return weight >= -kLargestRepair; };  // false for NaN
  if (!std::ranges::all_of(weights, is_near)) return std::nullopt;
  if (!(std::abs(sum_of() - 1.0) <= kLargestRepair)) return std::nullopt;
  WeightRepair repair;
  for (double& weight : weights) {
    if (weight >= 0.0) continue;
    repair.clipped -= weight;
    weight = 0.0;
  }
  const double sum = sum_of();
  repair.rescaled = sum - 1.0;
  for (double& weight : weights) weight /= sum;
  return repair;
}

std::string describe(const WeightRepair& repair) {
  if (!repair.any()) return {};
  const std::string sum = fmt::format("a sum of 1 {} {:.2g} put right",
                                      repair.rescaled < 0.0 ? "-" : "+", std::abs(repair.rescaled));
  if (repair.clipped == 0.0) return "weights repaired: " + sum;
  return fmt::format("weights repaired: {:.2g} below zero clipped, {}", repair.clipped, sum);
}

}  // namespace graybox
