#include "solvers/ellipsoid/point_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "problems/base/error.hpp"
#include "solvers/kernels/distance_kernels.hpp"

namespace graybox {
namespace {

constexpr std::size_t kBlock = 2048;  // points
// Squares of coordinates over ranges, of all points or of some, stay within double precision.
constexpr double kSmallestRange = 1e-70;
constexpr double kLargestMagnitude = 1e70;

void require_range(const PointSet& points, bool centred) {
  for (std::size_t j = 0; j < points.dimension; ++j) {
    const double low = points.lower[j], high = points.upper[j];
    const double largest = std::max(std::abs(low), std::abs(high));
    const double range = centred ? largest : high - low;
    if (range == 0.0) {
      throw InputError(fmt::format(
          "{}: column '{}' is {} in every row: the points lie in a hyperplane and the smallest "
          "ellipsoid has no volume; leave that column out",
          points.path, points.names[j], low));
    }
    if (!(range >= kSmallestRange) || !(largest <= kLargestMagnitude)) {
      throw InputError(fmt::format("{}: column '{}' goes from {} to {}; choose another unit for it",
                                   points.path, points.names[j], low, high));
    }
  }
}

}  // namespace

PointSet point_set(NumberTable table, bool centred) {
  PointSet points;
  points.path = std::move(table.path);
  points.names = std::move(table.names);
  points.count = table.rows;
  points.dimension = table.columns;
  points.values = std::move(table.values);
  points.lines = std::move(table.lines);
  if (points.names.empty()) {
    for (std::size_t j = 1; j <= points.dimension; ++j)
      points.names.push_back(fmt::format("x{}", j));
  }
  const std::size_t needed = points.dimension + (centred ? 0 : 1);
  if (points.count < needed) {
    throw InputError(fmt::format(
        "{}: {} point{} in {} dimensions lie in a hyperplane; at least {} are needed", points.path,
        points.count, points.count == 1 ? "" : "s", points.dimension, needed));
  }
  find_range(points);
  require_range(points, centred);
  return points;
}

void find_range(PointSet& points) {
  points.lower.assign(points.values.begin(),
                      points.values.begin() + static_cast<std::ptrdiff_t>(points.dimension));
  points.upper = points.lower;
  for (std::size_t i = 1; i < points.count; ++i) {
    const double* x = points.point(i);
    for (std::size_t j = 0; j < points.dimension; ++j) {
      points.lower[j] = std::min(points.lower[j], x[j]);
      points.upper[j] = std::max(points.upper[j], x[j]);
    }
  }
}

PointSet subset(const PointSet& points, std::span<const std::size_t> indices) {
  PointSet chosen;
  chosen.path = points.path;
  chosen.names = points.names;
  chosen.lower = points.lower;
  chosen.upper = points.upper;
  chosen.count = indices.size();
  chosen.dimension = points.dimension;
  chosen.values.resize(indices.size() * points.dimension);
  for (std::size_t k = 0; k < indices.size(); ++k) {
    if (!points.lines.empty()) chosen.lines.push_back(points.lines[indices[k]]);
    std::copy_n(points.point(indices[k]), points.dimension,
                chosen.values.begin() + static_cast<std::ptrdiff_t>(k * points.dimension));
  }
  return chosen;
}

bool squared_distances(const PointSet& points, const Ellipsoid& ellipsoid, int threads,
                       const StopClock& clock, std::span<double> out) {
  const std::size_t n = points.dimension;
  std::vector<double> panels(distance_panel_size(n));
  pack_distance_panels(ellipsoid.factor.data(), n, panels.data());
  const auto blocks = static_cast<std::ptrdiff_t>((points.count + kBlock - 1) / kBlock);
  const int used = blocks < 4 ? 1 : threads;
  std::atomic<bool> stopped = false;
#pragma omp parallel num_threads(used) if (used > 1)
  {
    std::vector<double> workspace(distance_workspace_size(n));
#pragma omp for schedule(static)
    for (std::ptrdiff_t b = 0; b < blocks; ++b) {
      if (stopped.load(std::memory_order_relaxed)) continue;
      if (clock.stops()) stopped = true;
      const std::size_t from = static_cast<std::size_t>(b) * kBlock;
      distance_kernels().squared(points.point(from), std::min(kBlock, points.count - from), n,
                                 ellipsoid.centre.data(), ellipsoid.remainder.data(), panels.data(),
                                 workspace.data(), out.data() + from);
    }
  }
  return !stopped;
}

}  // namespace graybox
