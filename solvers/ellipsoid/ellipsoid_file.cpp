#include "solvers/ellipsoid/ellipsoid_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string_view>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/program_version.hpp"

namespace graybox {
namespace {

using EllipsoidJson = nlohmann::ordered_json;

EllipsoidJson matrix_rows(const std::vector<double>& values, std::size_t columns) {
  EllipsoidJson rows = EllipsoidJson::array();
  for (std::size_t from = 0; from < values.size(); from += columns) {
    rows.push_back(
        std::vector<double>(values.begin() + static_cast<std::ptrdiff_t>(from),
                            values.begin() + static_cast<std::ptrdiff_t>(from + columns)));
  }
  return rows;
}

std::vector<double> full_lower(const Ellipsoid& ellipsoid) {
  const std::size_t n = ellipsoid.dimension;
  std::vector<double> full(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) full[i * n + j] = ellipsoid.factor[packed_index(i, j)];
  }
  return full;
}

double distance(const PointSet& points, std::size_t i, const Ellipsoid& ellipsoid,
                ExtendedPlace& place) {
  place_in_frame(points, i, ellipsoid, place);
  return static_cast<double>(
      std::sqrt(std::inner_product(place.y.begin(), place.y.end(), place.y.begin(), 0.0L)));
}

EllipsoidJson contact_entries(const PointSet& points, const EllipsoidSolution& solution) {
  std::vector<std::size_t> order(solution.support.indices.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto& weights = solution.support.weights;
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return weights[a] > weights[b]; });
  EllipsoidJson entries = EllipsoidJson::array();
  ExtendedPlace place;
  for (const std::size_t k : order) {
    const std::size_t i = solution.support.indices[k];
    const double* x = points.point(i);
    entries.push_back({{"index", i},
                       {"weight", weights[k]},
                       {"distance", distance(points, i, solution.ellipsoid, place)},
                       {"point", std::vector<double>(x, x + points.dimension)}});
  }
  return entries;
}

EllipsoidJson dropped_entries(const PointSet& points, const std::vector<DroppedPoint>& dropped) {
  EllipsoidJson entries = EllipsoidJson::array();
  for (const DroppedPoint& point : dropped) {
    const double* x = points.point(point.index);
    entries.push_back({{"index", point.index},
                       {"weight", point.weight},
                       {"volume_factor", point.volume_factor},
                       {"point", std::vector<double>(x, x + points.dimension)}});
  }
  return entries;
}

}  // namespace

nlohmann::ordered_json ellipsoid_json(const PointSet& points, const EllipsoidOptions& options,
                                      const PeeledEllipsoid& found) {
  const EllipsoidSolution& solution = found.solution;
  const Ellipsoid& ellipsoid = solution.ellipsoid;
  const EllipsoidCertificate& certificate = solution.certificate;
  EllipsoidJson axes = EllipsoidJson::array();
  for (const SemiAxis& axis : semi_axes(ellipsoid)) {
    axes.push_back({{"length", axis.length}, {"direction", axis.direction}});
  }
  EllipsoidJson root{
      {"format", kEllipsoidFormat},
      {"written_by", written_by()},
      {"points", points.path},
      {"count", points.count},
      {"dimension", points.dimension},
      {"names", points.names},
      {"centred", options.centred},
      {"status", to_string(solution.status)},
      {"options",
       {{"gap", options.gap},
        {"time_limit", options.time_limit},
        {"threads", options.threads},
        {"seed", options.seed}}},
      {"centre", ellipsoid.centre},
      {"centre_remainder", ellipsoid.remainder},
      {"factor", matrix_rows(full_lower(ellipsoid), points.dimension)},
      {"shape", matrix_rows(shape_matrix(ellipsoid), points.dimension)},
      {"semi_axes", std::move(axes)},
      {"log_volume", certificate.log_volume},
      {"volume_bound", certificate.volume_bound},
      {"rounding_bound", certificate.rounding_bound},
      {"largest_distance", certificate.largest_distance},
      {"contact", contact_entries(points, solution)},
      {"counters",
       {{"rounds", solution.rounds}, {"passes", solution.passes}, {"seconds", solution.seconds}}}};
  if (!found.dropped.empty()) root["dropped"] = dropped_entries(points, found.dropped);
  return root;
}

}  // namespace graybox
