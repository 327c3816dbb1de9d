#include "diagnosis/log_columns/encoder_steps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

constexpr double kNear = 1e-4;  // of a step that is known exactly

struct Grid {
  double step = 0.0;
  double error = 0.0;  // of the step, relative: by the rounding of the values
};

// The grid that all values lie on.
std::optional<Grid> grid_of(const Eigen::VectorXd& values) {
  constexpr double kSame = 1e-9;   // of the span
  constexpr double kWhole = 0.02;  // of a step
  std::vector<double> levels(values.begin(), values.end());
  std::ranges::sort(levels);
  const double lowest = levels.front(), span = levels.back() - lowest;
  const auto same = [&](double a, double b) { return b - a <= kSame * span; };
  levels.erase(std::unique(levels.begin(), levels.end(), same), levels.end());
  double smallest = span;
  for (std::size_t k = 1; k < levels.size(); ++k) {
    smallest = std::min(smallest, levels[k] - levels[k - 1]);
  }
  std::vector<double> counts{0.0};
  for (std::size_t k = 1; k < levels.size(); ++k) {
    counts.push_back(counts.back() + std::round((levels[k] - levels[k - 1]) / smallest));
  }
  const double step = (levels.back() - lowest) / counts.back();
  double most = 0.0;
  for (std::size_t k = 0; k < levels.size(); ++k) {
    most = std::max(most, std::abs(levels[k] - lowest - step * counts[k]));
  }
  if (!(most <= kWhole * step)) return {};
  return Grid{step, 2.0 * most / (counts.back() * step)};
}

bool is_printed(double step, double error) {
  const double power = std::pow(10.0, std::floor(std::log10(step * (1.0 + error))));
  return std::ranges::any_of(std::array{1.0, 2.0, 2.5, 5.0}, [&](double digit) {
    return std::abs(step / (digit * power) - 1.0) <= error;
  });
}

// Counts a turn that are usual.
std::vector<double> usual_counts() {
  constexpr int kFewestBits = 8, kMostBits = 20;
  std::vector<double> counts;
  for (int bits = kFewestBits; bits <= kMostBits; ++bits) counts.push_back(std::ldexp(1.0, bits));
  for (const double lines : {100, 200, 250, 360, 500, 600, 1000, 2000, 2500, 5000}) {
    counts.push_back(4.0 * lines);
  }
  return counts;
}

}  // namespace

std::optional<EncoderSteps> find_encoder_steps(const Eigen::VectorXd& values) {
  if (values.size() < 2 || has_few_levels(values)) return {};
  const std::optional<Grid> grid = grid_of(values);
  if (!grid) return {};
  double least = kNear + grid->error;
  if (is_printed(grid->step, least)) return {};
  std::optional<EncoderSteps> found;
  for (const double counts : usual_counts()) {
    const double in_degrees = std::abs(grid->step * counts / 360.0 - 1.0);
    const double in_radians = std::abs(grid->step * counts / (2.0 * std::numbers::pi) - 1.0);
    if (std::min(in_degrees, in_radians) > least) continue;
    least = std::min(in_degrees, in_radians);
    const bool is_degrees = in_degrees < in_radians;
    found = {is_degrees ? "deg" : "rad",
             fmt::format("{}/{:g}", is_degrees ? "360" : "2 pi", counts)};
  }
  return found;
}

std::optional<double> counts_of_encoders(double estimate) {
  constexpr double kSpeed = 1e-3;  // of what a logged speed tells
  constexpr double kFewest = 40.0;
  if (!(estimate >= kFewest) || !std::isfinite(estimate)) return {};
  std::vector<double> counts = usual_counts();
  const double power = std::pow(10.0, std::floor(std::log10(estimate / 4.0)) - 1.0);
  counts.push_back(4.0 * power * std::round(estimate / (4.0 * power)));
  const double nearest =
      *std::ranges::min_element(counts, {}, [&](double each) { return std::abs(each - estimate); });
  if (std::abs(nearest - estimate) > kSpeed * estimate) return {};
  return std::round(nearest);
}

}  // namespace graybox
