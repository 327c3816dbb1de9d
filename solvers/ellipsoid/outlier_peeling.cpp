#include "solvers/ellipsoid/outlier_peeling.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

constexpr std::size_t kTried = 10;  // contact points to leave out, on trial

// The smallest ellipsoid without the points dropped, with indices of all points.
EllipsoidSolution solve_without(const PointSet& points, const EllipsoidOptions& options,
                                const std::vector<DroppedPoint>& dropped) {
  std::vector<std::size_t> indices;
  for (const DroppedPoint& point : dropped) indices.push_back(point.index);
  const RemainingPoints rest = points_without(points, indices);
  EllipsoidSolution solution = smallest_ellipsoid(rest.points, options);
  for (std::size_t& index : solution.support.indices) index = rest.indices[index];
  solution.certificate.farthest = rest.indices[solution.certificate.farthest];
  return solution;
}

// Positions in the support, heaviest first, at most kTried.
std::vector<std::size_t> heaviest(const WeightedPoints& support) {
  std::vector<std::size_t> order(support.weights.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(
      order, [&](std::size_t a, std::size_t b) { return support.weights[a] > support.weights[b]; });
  order.resize(std::min(order.size(), kTried));
  return order;
}

// One more point left out, that without which the ellipsoid is smallest. Throws Stopped.
PeeledEllipsoid peel_once(const PointSet& points, const EllipsoidOptions& options,
                          const PeeledEllipsoid& before) {
  const WeightedPoints& support = before.solution.support;
  PeeledEllipsoid best;
  for (const std::size_t k : heaviest(support)) {
    stop_if_requested();
    PeeledEllipsoid trial{{}, before.dropped};
    trial.dropped.push_back({support.indices[k], support.weights[k], 1.0});
    trial.solution = solve_without(points, options, trial.dropped);
    if (best.dropped.empty() ||
        trial.solution.certificate.log_volume < best.solution.certificate.log_volume) {
      best = std::move(trial);
    }
  }
  best.dropped.back().volume_factor =
      std::exp(best.solution.certificate.log_volume - before.solution.certificate.log_volume);
  return best;
}

}  // namespace

RemainingPoints points_without(const PointSet& points, const std::vector<std::size_t>& dropped) {
  std::vector<bool> leaves(points.count, false);
  for (const std::size_t index : dropped) leaves[index] = true;
  RemainingPoints rest;
  for (std::size_t i = 0; i < points.count; ++i) {
    if (!leaves[i]) rest.indices.push_back(i);
  }
  rest.points = subset(points, rest.indices);
  find_range(rest.points);
  return rest;
}

PeeledEllipsoid peeled_ellipsoid(const PointSet& points, const EllipsoidOptions& options,
                                 std::size_t count) {
  const std::size_t needed = points.dimension + (options.centred ? 0 : 1);
  if (count + needed > points.count) {
    throw InputError(
        fmt::format("{}: without {} of its {} points fewer than {} are left; drop fewer",
                    points.path, count, points.count, needed));
  }
  const TimeLimit limit(options.time_limit);
  PeeledEllipsoid peeled{smallest_ellipsoid(points, options), {}};
  try {
    while (peeled.dropped.size() < count) peeled = peel_once(points, options, peeled);
  } catch (const Stopped&) {  // what there is, is handed over
  }
  if (peeled.dropped.size() < count) peeled.solution.status = EllipsoidStatus::kTimeLimit;
  return peeled;
}

}  // namespace graybox
