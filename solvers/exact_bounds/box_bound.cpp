#include "solvers/exact_bounds/box_bound.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace graybox {

double BoxBound::evaluate(std::span<const double> g, std::span<const std::int32_t> lower,
                          std::span<const std::int32_t> upper, std::int64_t experiments,
                          double log_det_dual, double slack) {
  heap_.clear();
  std::int64_t left = experiments;
  total_ = 0.0;
  for (std::size_t i = 0; i < g.size(); ++i) {
    left -= lower[i];
    total_ += static_cast<double>(lower[i]) * g[i];
    if (upper[i] > lower[i]) heap_.emplace_back(g[i], upper[i] - lower[i]);
  }
  experiments_ = experiments;
  log_det_dual_ = log_det_dual;
  slack_ = slack;
  multiplier_ = -std::numeric_limits<double>::infinity();
  bound_ = -std::numeric_limits<double>::infinity();
  if (left < 0) return bound_;
  std::ranges::make_heap(heap_);
  auto end = heap_.end();
  while (left > 0) {
    if (end == heap_.begin()) return bound_;
    std::pop_heap(heap_.begin(), end);
    --end;
    const std::int64_t taken = std::min<std::int64_t>(left, end->second);
    total_ += static_cast<double>(taken) * end->first;
    multiplier_ = end->first;
    left -= taken;
  }
  total_ += static_cast<double>(experiments) * slack;
  bound_ = dimension_ * std::log(total_ / dimension_) - log_det_dual;
  bound_ += 4.0 * std::numeric_limits<double>::epsilon() *
            (dimension_ + std::abs(bound_) + std::abs(log_det_dual));
  return bound_;
}

std::size_t BoxBound::tighten(std::span<const double> g, double threshold, BoxLimits limits) const {
  if (!std::isfinite(multiplier_) || !std::isfinite(threshold)) return 0;
  const double needed = dimension_ * std::exp((threshold + log_det_dual_) / dimension_);
  // A little more room than (4) and (5) ask for, so that rounding here removes nothing it should
  // not.
  const double room = (total_ - needed) * (1.0 + 1e-9) + 1e-12 * total_;
  if (!(room >= 0.0)) return 0;
  std::size_t moved = 0;
  for (std::size_t i = 0; i < g.size(); ++i) {
    const std::int32_t width = limits.upper[i] - limits.lower[i];
    if (width == 0) continue;
    const double cost = std::abs(multiplier_ - g[i]) - 2.0 * slack_;
    if (!(cost * static_cast<double>(width) > room)) continue;
    const auto steps = static_cast<std::int32_t>(room / cost);
    if (g[i] < multiplier_) {
      limits.upper[i] = limits.lower[i] + steps;
    } else {
      limits.lower[i] = limits.upper[i] - steps;
    }
    ++moved;
  }
  return moved;
}

}  // namespace graybox
