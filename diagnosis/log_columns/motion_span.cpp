#include "diagnosis/log_columns/motion_span.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "diagnosis/signals/real_transform.hpp"
#include "problems/base/quantile.hpp"

namespace graybox {
namespace {

constexpr double kMoves = 0.01;  // of the usual largest change
constexpr double kShareOfPower = 0.99;
constexpr double kAbove = 15.0;  // the filter over the motion's frequency
constexpr double kLowest = 2.0;  // Hz

// What changes: positions over `over` samples, velocities as they are. Gaps count as rest.
Eigen::VectorXd changes(const Eigen::VectorXd& motion, bool is_velocity, Eigen::Index over) {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(motion.size());
  for (Eigen::Index k = 0; k < motion.size(); ++k) {
    const double before = is_velocity ? 0.0 : motion(std::max<Eigen::Index>(0, k - over));
    const double size = std::abs(motion(k) - before);
    if (std::isfinite(size)) change(k) = size;
  }
  return change;
}

// The largest change but for those of a few samples, as spikes make them.
double usual_largest(const Eigen::VectorXd& change, Eigen::Index over) {
  constexpr double kOfSpikes = 0.002;  // of all samples
  const Eigen::Index n = change.size();
  const auto spikes =
      std::min(n - 1, 4 * over + static_cast<Eigen::Index>(kOfSpikes * static_cast<double>(n)));
  std::vector<double> sorted(change.begin(), change.end());
  std::ranges::nth_element(sorted, sorted.end() - 1 - spikes);
  const double usual = *(sorted.end() - 1 - spikes);
  return usual > 0.0 ? usual : change.maxCoeff();
}

Eigen::Index samples_of_velocity(const Eigen::VectorXd& motion, bool is_velocity) {
  return is_velocity ? motion.size() : motion.size() - 2;
}

// The power of the velocity, from 0 Hz in steps of one over the time of its samples.
Eigen::VectorXd power_of_velocity(const Eigen::VectorXd& motion, bool is_velocity) {
  const Eigen::Index n = samples_of_velocity(motion, is_velocity);
  Eigen::VectorXd velocity =
      is_velocity ? motion : Eigen::VectorXd(motion.tail(n) - motion.head(n));
  for (Eigen::Index k = 0; k < n; ++k) {
    if (!std::isfinite(velocity(k))) velocity(k) = 0.0;
  }
  velocity.array() -= velocity.mean();
  for (Eigen::Index k = 0; k < n; ++k) {
    const double turn =
        2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(n - 1);
    velocity(k) *= 0.5 - 0.5 * std::cos(turn);
  }
  RealTransform transform(static_cast<std::size_t>(n));
  return transform.run(velocity).cwiseAbs2();
}

// The frequency below which most of the power of the velocity lies.
double highest_frequency(const Eigen::VectorXd& motion, bool is_velocity, double sample_time) {
  const Eigen::VectorXd power = power_of_velocity(motion, is_velocity);
  const Eigen::Index n = samples_of_velocity(motion, is_velocity);
  double sum = 0.0;
  Eigen::Index k = 0;
  while (k + 1 < power.size() && sum + power(k) < kShareOfPower * power.sum()) sum += power(k++);
  return static_cast<double>(k) / (static_cast<double>(n) * sample_time);
}

}  // namespace

MotionSpan motion_span(const std::vector<Eigen::VectorXd>& motions, bool are_velocities,
                       double sample_time) {
  const Eigen::Index n = motions.front().size();
  const auto over = std::max<Eigen::Index>(2, std::lround(0.02 / sample_time));
  MotionSpan span{n - 1, 0};
  for (const Eigen::VectorXd& motion : motions) {
    const Eigen::VectorXd change = changes(motion, are_velocities, over);
    const double limit = kMoves * usual_largest(change, over);
    for (Eigen::Index k = 0; k < n; ++k) {
      if (!(change(k) > limit)) continue;
      span.first = std::min(span.first, k);
      span.last = std::max(span.last, k);
    }
  }
  if (span.first >= span.last) return {0, n - 1};
  const auto margin = std::max<Eigen::Index>(over, std::lround(0.2 / sample_time));
  return {std::max<Eigen::Index>(0, span.first - margin), std::min(n - 1, span.last + margin)};
}

double motion_frequency(const std::vector<Eigen::VectorXd>& motions, bool are_velocities,
                        double sample_time) {
  std::vector<double> each;
  for (const Eigen::VectorXd& motion : motions) {
    each.push_back(highest_frequency(motion, are_velocities, sample_time));
  }
  std::ranges::sort(each);
  return quantile(each, 0.5);
}

double swing_frequency(const Eigen::VectorXd& motion, bool is_velocity, double sample_time) {
  constexpr Eigen::Index kFewest = 16, kFewestPeriods = 2;
  constexpr Eigen::Index kBeside = 2;   // lines: as wide as the window makes one
  constexpr double kShareOfLine = 0.5;  // of all power
  const Eigen::Index n = samples_of_velocity(motion, is_velocity);
  if (n < kFewest || !(sample_time > 0.0)) return 0.0;
  const Eigen::VectorXd power = power_of_velocity(motion, is_velocity);
  Eigen::Index line = 0;
  const double largest = power.maxCoeff(&line);
  if (!(largest > 0.0) || line < kFewestPeriods || line + kBeside >= power.size()) return 0.0;
  double sum = 0.0, moment = 0.0;
  for (Eigen::Index k = line - kBeside; k <= line + kBeside; ++k) {
    sum += power(k);
    moment += power(k) * static_cast<double>(k);
  }
  if (sum < kShareOfLine * power.sum()) return 0.0;
  return moment / (sum * static_cast<double>(n) * sample_time);
}

double filter_frequency(const std::vector<Eigen::VectorXd>& motions, bool are_velocities,
                        double sample_time) {
  const double moves = motion_frequency(motions, are_velocities, sample_time);
  const double most = std::max(kLowest, 0.2 / sample_time);
  const double frequency = std::min(std::clamp(kAbove * moves, kLowest, most), 0.4 / sample_time);
  return std::stod(fmt::format("{:.2g}", frequency));
}

}  // namespace graybox
