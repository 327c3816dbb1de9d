#include "problems/base/quantile.hpp"

#include <algorithm>
#include <cstddef>

namespace graybox {

double quantile(const std::vector<double>& sorted, double share) {
  const double position = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  const double weight = position - static_cast<double>(below);
  if (weight == 0.0) return sorted[below];  // infinity times zero is no number
  return (1.0 - weight) * sorted[below] + weight * sorted[above];
}

}  // namespace graybox
