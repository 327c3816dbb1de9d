#include "diagnosis/signals/controlled_drive.hpp"

#include <algorithm>
#include <cmath>

#include "problems/base/quantile.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

bool is_usable(const DriveAndSpeed& rows) {
  return rows.drive.size() > 0 && rows.drive.size() == rows.speed.size() &&
         rows.drive.allFinite() && rows.speed.allFinite();
}

double median_of(const VectorXd& values) {
  std::vector<double> sorted(values.begin(), values.end());
  std::ranges::sort(sorted);
  return quantile(sorted, 0.5);
}

double deviation_of(const VectorXd& values) {
  return std::sqrt((values.array() - values.mean()).square().mean());
}

// What a speed settles at while the drive stays: the median of its last eighth, if the eighth
// before has the same.
std::optional<double> settled(const VectorXd& speed, double largest) {
  constexpr Index kFewest = 20, kFewestAtEnd = 5;
  constexpr double kSame = 0.02, kNoise = 0.1;  // of the largest
  const Index n = speed.size(), part = std::max(kFewestAtEnd, n / 8);
  if (n < kFewest) return {};
  const VectorXd last = speed.tail(part);
  const double level = median_of(last);
  const double before = median_of(speed.segment(n - 2 * part, part));
  if (std::abs(level - before) > kSame * largest) return {};
  if (deviation_of(last) > kNoise * largest) return {};
  return level;
}

// False where a speed settles elsewhere.
bool collect_levels(const DriveAndSpeed& rows, double largest, std::vector<double>& levels) {
  constexpr double kLeast = 0.1, kAgree = 0.02;  // of the largest
  const VectorXd& drive = rows.drive;
  for (Index first = 0, end = 0; first < drive.size(); first = end) {
    for (end = first + 1; end < drive.size() && drive(end) == drive(first);) ++end;
    if (std::abs(drive(first)) < kLeast * largest) continue;
    const auto level = settled(rows.speed.segment(first, end - first), largest);
    if (!level) continue;
    if (std::abs(*level - drive(first)) > kAgree * largest) return false;
    levels.push_back(drive(first));
  }
  return true;
}

DriveAndSpeed joined(const std::vector<DriveAndSpeed>& recordings) {
  DriveAndSpeed all;
  for (const DriveAndSpeed& each : recordings) {
    if (!is_usable(each)) continue;
    const Index before = all.drive.size(), more = each.drive.size();
    all.drive.conservativeResize(before + more);
    all.speed.conservativeResize(before + more);
    all.drive.tail(more) = each.drive;
    all.speed.tail(more) = each.speed;
  }
  return all;
}

// All but a few rows lie within half of the mean speed.
bool is_about_one(const VectorXd& speed) {
  constexpr double kFew = 0.02, kNear = 0.5;
  const double mean = speed.mean();
  if (mean == 0.0) return false;
  const VectorXd shares = speed / mean;
  std::vector<double> sorted(shares.begin(), shares.end());
  std::ranges::sort(sorted);
  return quantile(sorted, kFew) >= 1.0 - kNear && quantile(sorted, 1.0 - kFew) <= 1.0 + kNear;
}

// Whether a signal is nearly its own negative some rows later, by its autocorrelation.
bool is_one_tone(const VectorXd& signal) {
  constexpr double kAlike = 0.8;
  constexpr Index kMostRows = 20000, kMostLag = 500;
  VectorXd x = signal.head(std::min(kMostRows, signal.size()));
  x.array() -= x.mean();
  const double square = x.squaredNorm();
  for (Index lag = 1; lag < std::min(kMostLag, x.size() / 2); ++lag) {
    if (x.head(x.size() - lag).dot(x.tail(x.size() - lag)) < -kAlike * square) return true;
  }
  return false;
}

// Least squares of the drive on the speed so many rows before.
SpeedFeedback line_of(const DriveAndSpeed& rows, Index late) {
  const Index n = rows.drive.size() - late;
  const Eigen::ArrayXd drive = rows.drive.tail(n).array() - rows.drive.tail(n).mean();
  const Eigen::ArrayXd speed = rows.speed.head(n).array() - rows.speed.head(n).mean();
  const double squares = speed.square().sum(), all = drive.square().sum();
  if (!(squares > 0.0) || !(all > 0.0)) return {};
  const double slope = (speed * drive).sum() / squares;
  return {rows.drive.tail(n).mean() - slope * rows.speed.head(n).mean(), -slope,
          slope * slope * squares / all};
}

}  // namespace

std::vector<double> levels_of_target(const std::vector<DriveAndSpeed>& recordings) {
  constexpr double kApart = 0.25;  // of the largest
  double largest = 0.0;
  for (const DriveAndSpeed& each : recordings) {
    if (is_usable(each)) largest = std::max(largest, each.drive.cwiseAbs().maxCoeff());
  }
  std::vector<double> levels;
  for (const DriveAndSpeed& each : recordings) {
    if (is_usable(each) && !collect_levels(each, largest, levels)) return {};
  }
  std::ranges::sort(levels);
  levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
  if (levels.empty() || levels.back() - levels.front() < kApart * largest) return {};
  return levels;
}

std::optional<SpeedFeedback> find_speed_feedback(const std::vector<DriveAndSpeed>& recordings) {
  constexpr Index kFewest = 50;
  constexpr double kMade = 0.9, kNear = 0.5;
  const DriveAndSpeed all = joined(recordings);
  if (all.drive.size() < kFewest || !is_about_one(all.speed)) return {};
  SpeedFeedback best;
  for (const Index late : {0, 1}) {
    const SpeedFeedback line = line_of(all, late);
    if (line.share > best.share) best = line;
  }
  if (!(best.gain > 0.0) || best.share < kMade) return {};
  const double zero = best.constant / best.gain;
  const bool is_near = std::abs(zero / all.speed.mean() - 1.0) <= kNear;
  if (!is_near || is_one_tone(all.drive)) return {};
  return best;
}

}  // namespace graybox
