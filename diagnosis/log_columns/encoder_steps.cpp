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

// Different values, rising.
std::vector<double> levels_of(const Eigen::VectorXd& values) {
  constexpr double kSame = 1e-9;  // of the span
  std::vector<double> levels(values.begin(), values.end());
  std::ranges::sort(levels);
  const double span = levels.back() - levels.front();
  const auto same = [&](double a, double b) { return b - a <= kSame * span; };
  levels.erase(std::unique(levels.begin(), levels.end(), same), levels.end());
  return levels;
}

// The grid that all levels lie on.
std::optional<Grid> grid_of(const std::vector<double>& levels) {
  constexpr double kWhole = 0.02;  // of a step
  const double lowest = levels.front();
  double smallest = levels.back() - lowest;
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

// The grid of levels that were rounded to `printed`, so that their steps are of two sizes. Least
// squares of the levels on their counts leave no more than the rounding.
std::optional<Grid> rounded_grid(const std::vector<double>& levels, double printed) {
  constexpr double kCoarser = 5.0;      // times the print, so that chance makes no grid
  constexpr double kNext = 1.5;         // of the smallest step: one count, too
  constexpr double kRounding = 1.1;     // of the print: half of it either way, and a little
  constexpr double kMostError = 0.005;  // of a step: 4000 and 4096 counts differ by 2.4 %
  const auto n = static_cast<Eigen::Index>(levels.size());
  const Eigen::ArrayXd all = Eigen::Map<const Eigen::ArrayXd>(levels.data(), n);
  const double span = all(n - 1) - all(0);
  const Eigen::ArrayXd steps = all.tail(n - 1) - all.head(n - 1);
  const Eigen::ArrayXd next = (steps <= kNext * steps.minCoeff()).cast<double>();
  const double near = (steps * next).sum() / next.sum(), error = printed / span;
  if (!(near >= kCoarser * printed) || !(error <= kMostError)) return {};
  Eigen::ArrayXd counts = Eigen::ArrayXd::Zero(n);
  for (Eigen::Index k = 1; k < n; ++k) counts(k) = counts(k - 1) + std::round(steps(k - 1) / near);
  counts -= counts.mean();
  const double step = (counts * all).sum() / counts.square().sum();
  const Eigen::ArrayXd left = all - step * counts;
  if (!(left.maxCoeff() - left.minCoeff() <= kRounding * printed)) return {};
  return Grid{step, error};
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

double printed_step(const Eigen::VectorXd& values) {
  constexpr int kDigits = 6;
  constexpr double kWhole = 1e-6;
  for (int digits = 0; digits <= kDigits; ++digits) {
    const double power = std::pow(10.0, digits);
    const Eigen::ArrayXd scaled = values.array() * power;
    if (((scaled - scaled.round()).abs() <= kWhole * scaled.abs().max(1.0)).all()) {
      return 1.0 / power;
    }
  }
  return 0.0;
}

std::optional<EncoderSteps> find_encoder_steps(const Eigen::VectorXd& values) {
  if (values.size() < 2 || has_few_levels(values)) return {};
  const std::vector<double> levels = levels_of(values);
  std::optional<Grid> grid = grid_of(levels);
  if (const double printed = printed_step(values); !grid && printed > 0.0) {
    grid = rounded_grid(levels, printed);
  }
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
