#include "cli/ellipsoid/ellipsoid_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace graybox::cli {
namespace {

constexpr std::size_t kShownCoordinates = 6;
constexpr std::size_t kShownPoints = 10;

std::string volume_text(const EllipsoidCertificate& certificate) {
  const std::string logarithm = fmt::format("log volume {:.10g}", certificate.log_volume);
  const double volume = std::exp(certificate.log_volume);
  if (!std::isnormal(volume)) return logarithm;
  return fmt::format("{:.10g}  ({})", volume, logarithm);
}

std::string bound_text(const EllipsoidCertificate& certificate, double gap) {
  return fmt::format("at most {:.3e} of it above the smallest  (asked {:.3g}; rounding {:.1e})",
                     certificate.volume_bound, gap, certificate.rounding_bound);
}

// "name value" for the first few coordinates.
std::string coordinates_text(const PointSet& points, const std::vector<double>& values) {
  const std::size_t shown = std::min(kShownCoordinates, values.size());
  std::string text;
  for (std::size_t j = 0; j < shown; ++j) {
    text += fmt::format("{}{} {:.6g}", j > 0 ? ", " : "", points.names[j], values[j]);
  }
  if (shown < values.size()) text += fmt::format(", and {} more", values.size() - shown);
  return text;
}

std::string axes_text(const PointSet& points, const Ellipsoid& ellipsoid) {
  const std::vector<SemiAxis> axes = semi_axes(ellipsoid);
  std::string text;
  const std::size_t shown = std::min(kShownCoordinates, axes.size());
  for (std::size_t k = 0; k < shown; ++k) {
    text += fmt::format("  {:<13} {:.6g} along {}\n", k == 0 ? "semi-axes" : "", axes[k].length,
                        coordinates_text(points, axes[k].direction));
  }
  if (shown < axes.size()) {
    text += fmt::format("  {:<13} and {} shorter ones\n", "", axes.size() - shown);
  }
  return text;
}

std::string time_text(double seconds) {
  return seconds < 1.0 ? fmt::format("{:.3g} ms", 1e3 * seconds) : fmt::format("{:.3g} s", seconds);
}

std::string point_heading(const PointSet& points, const std::string& first) {
  std::string text = fmt::format("  {:>10} {:>10}", first, points.lines.empty() ? "row" : "line");
  for (std::size_t j = 0; j < std::min(kShownCoordinates, points.dimension); ++j) {
    text += fmt::format(" {:>12}", points.names[j]);
  }
  return text + '\n';
}

std::string point_row(const PointSet& points, double first, std::size_t i) {
  std::string text =
      fmt::format("  {:>10.6f} {:>10}", first, points.lines.empty() ? i : points.lines[i]);
  for (std::size_t j = 0; j < std::min(kShownCoordinates, points.dimension); ++j) {
    text += fmt::format(" {:>12.6g}", points.point(i)[j]);
  }
  return text + '\n';
}

}  // namespace

std::string describe_points(const PointSet& points) {
  return fmt::format("{} points in {} dimension{}", points.count, points.dimension,
                     points.dimension == 1 ? "" : "s");
}

std::string describe_ellipsoid(const PointSet& points, const EllipsoidOptions& options,
                               const EllipsoidSolution& solution) {
  std::string text = fmt::format("ellipsoid: {}\n", to_string(solution.status));
  if (!solution.certificate.contains_all()) {
    text += fmt::format("  NOT all points are inside: the farthest is at {:.17g}\n",
                        solution.certificate.largest_distance);
  }
  text += fmt::format("  volume        {}\n", volume_text(solution.certificate));
  text += fmt::format("  bound         {}\n", bound_text(solution.certificate, options.gap));
  text += fmt::format("  centre        {}\n",
                      options.centred ? "the origin, as asked"
                                      : coordinates_text(points, solution.ellipsoid.centre));
  text += axes_text(points, solution.ellipsoid);
  text += fmt::format("  work          {} rounds, {:.1f} passes, {}\n", solution.rounds,
                      solution.passes, time_text(solution.seconds));
  return text;
}

std::string describe_contact(const PointSet& points, const EllipsoidSolution& solution) {
  const std::vector<double>& weights = solution.support.weights;
  std::vector<std::size_t> order(weights.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return weights[a] > weights[b]; });
  std::string text = fmt::format(
      "  contact       {} points hold the ellipsoid, heaviest first: look at them as outliers\n",
      weights.size());
  text += point_heading(points, "weight");
  for (std::size_t rank = 0; rank < std::min(order.size(), kShownPoints); ++rank) {
    const std::size_t k = order[rank];
    text += point_row(points, weights[k], solution.support.indices[k]);
  }
  if (order.size() > kShownPoints) {
    text += fmt::format("  {:>10} and {} more\n", "...", order.size() - kShownPoints);
  }
  return text;
}

std::string describe_dropped(const PointSet& points, const std::vector<DroppedPoint>& dropped) {
  if (dropped.empty()) return {};
  std::string text = "  dropped       one after the other; factor by which the volume fell\n";
  text += point_heading(points, "factor");
  for (const DroppedPoint& point : dropped) {
    text += point_row(points, point.volume_factor, point.index);
  }
  return text;
}

std::string describe_check(const PointSet& points, double gap,
                           const EllipsoidCertificate& certificate) {
  std::string text;
  if (certificate.contains_all()) {
    text = "ellipsoid: contains all points\n";
  } else {
    const std::size_t i = certificate.farthest;
    text =
        fmt::format("ellipsoid: does NOT contain all points; {} {} is at {:.17g} of the radius\n",
                    points.lines.empty() ? "row" : "line",
                    points.lines.empty() ? i : points.lines[i], certificate.largest_distance);
  }
  text += fmt::format("  volume        {}\n", volume_text(certificate));
  text += fmt::format("  bound         {}{}\n", bound_text(certificate, gap),
                      certificate.contains_all() ? "" : ", once scaled to contain them");
  return text;
}

}  // namespace graybox::cli
