#include "diagnosis/verdict/law_figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "problems/base/quantile.hpp"

namespace graybox {
namespace {

constexpr const char* kBlue = "#0072b2";
constexpr const char* kGrey = "#999999";
constexpr std::size_t kPoints = 1500;
constexpr std::size_t kLinePoints = 150;
constexpr std::size_t kBandPoints = 60;
// Mean step between neighbours on the axis, of the law's range, that a function of the axis alone
// has.
constexpr double kSmooth = 0.02;
constexpr double kOutside = 0.005;  // of the recorded forces, at either end

std::vector<std::size_t> order_of(const std::vector<double>& x) {
  std::vector<std::size_t> order(x.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&x](std::size_t i) { return x[i]; });
  return order;
}

bool is_function_of(const std::vector<double>& force, const std::vector<std::size_t>& order) {
  if (order.size() < 2) return false;
  double steps = 0.0;
  for (std::size_t i = 1; i < order.size(); ++i) {
    steps += std::abs(force[order[i]] - force[order[i - 1]]);
  }
  const auto [low, high] = std::ranges::minmax(force);
  return steps <= kSmooth * (high - low) * static_cast<double>(order.size() - 1);
}

// The law as means of equally many neighbours on the axis. Its band is the rms distance of the
// recorded forces from it there; none where no forces are recorded.
ChartSeries law_line(const std::vector<double>& x, const ForcePicture& picture,
                     const std::vector<std::size_t>& order) {
  ChartSeries line;
  const std::size_t bins = picture.force.empty() ? kLinePoints : kBandPoints;
  for (std::size_t b = 0; b < bins; ++b) {
    const std::size_t first = b * order.size() / bins, end = (b + 1) * order.size() / bins;
    if (end == first) continue;
    const auto count = static_cast<double>(end - first);
    double mean_x = 0.0, mean_law = 0.0, square = 0.0;
    for (std::size_t i = first; i < end; ++i) {
      const double law = picture.law_force[order[i]];
      mean_x += x[order[i]] / count;
      mean_law += law / count;
      if (!picture.force.empty()) square += std::pow(picture.force[order[i]] - law, 2);
    }
    line.x.push_back(mean_x);
    line.y.push_back(mean_law);
    if (!picture.force.empty()) line.band.push_back(std::sqrt(square / count));
  }
  return line;
}

std::vector<double> thinned(const std::vector<double>& values) {
  const std::size_t stride = values.size() / kPoints + 1;
  std::vector<double> kept;
  for (std::size_t i = 0; i < values.size(); i += stride) kept.push_back(values[i]);
  return kept;
}

// Without the few beyond what the axis shows.
std::vector<double> shown_forces(const ForcePicture& picture) {
  std::vector<double> sorted = picture.force;
  std::ranges::sort(sorted);
  auto [low, high] = std::ranges::minmax(picture.law_force);
  low = std::min(low, quantile(sorted, kOutside));
  high = std::max(high, quantile(sorted, 1.0 - kOutside));
  std::vector<double> shown = picture.force;
  for (double& force : shown) {
    if (force < low || force > high) force = std::numeric_limits<double>::quiet_NaN();
  }
  return shown;
}

ChartSeries recorded_points(const ForcePicture& picture, const std::vector<double>& x) {
  std::string name = "measured, less the rest of the model";
  if (picture.force_deviation > 0.0) {
    name += fmt::format(" (noise {:.2g} {})", picture.force_deviation, picture.force_unit);
  }
  return {name, thinned(x), thinned(shown_forces(picture)), kGrey, true};
}

}  // namespace

bool is_function_of_axis(const ForcePicture& picture, bool over_rate) {
  return is_function_of(picture.law_force, order_of(over_rate ? picture.rate : picture.deflection));
}

Chart law_chart(const ForcePicture& picture, const std::string& title, bool over_rate) {
  const std::vector<double>& x = over_rate ? picture.rate : picture.deflection;
  Chart chart;
  chart.title = title;
  chart.x.label = over_rate ? fmt::format("velocity, {}", picture.rate_unit)
                            : fmt::format("deflection, {}", picture.deflection_unit);
  chart.y.label = fmt::format("force, {}", picture.force_unit);
  if (!picture.force.empty()) chart.series.push_back(recorded_points(picture, x));
  const std::vector<std::size_t> order = order_of(x);
  if (is_function_of(picture.law_force, order)) {
    ChartSeries law = law_line(x, picture, order);
    law.name = law.band.empty() ? "fitted law" : "fitted law and rms distance";
    law.colour = kBlue;
    chart.series.push_back(std::move(law));
  } else {
    chart.series.push_back({"fitted law", thinned(x), thinned(picture.law_force), kBlue, true});
  }
  return chart;
}

}  // namespace graybox
