#include "diagnosis/first_masses/undriven_gain.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "problems/base/quantile.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kFewest = 20;              // samples
constexpr double kLow = 0.1, kHigh = 0.9;  // of what is gained: where a gain begins and ends

// Over a hundredth of the log to either side, which passes over the steps of an encoder.
VectorXd rate_of(const VectorXd& times, const VectorXd& place) {
  const Index n = place.size(), half = std::max<Index>(1, n / 100);
  VectorXd rate = VectorXd::Zero(n);
  for (Index k = 0; k < n; ++k) {
    const Index a = std::max<Index>(0, k - half), b = std::min(n - 1, k + half);
    if (times(b) > times(a)) rate(k) = (place(b) - place(a)) / (times(b) - times(a));
  }
  return rate;
}

VectorXd place_of(const VectorXd& times, const VectorXd& speed) {
  VectorXd place = VectorXd::Zero(speed.size());
  for (Index k = 1; k < speed.size(); ++k) {
    place(k) = place(k - 1) + 0.5 * (speed(k) + speed(k - 1)) * (times(k) - times(k - 1));
  }
  return place;
}

// A weight or a spring that turns the motion round gives back the speed that it took: the motion
// goes the other way at half the speed or more. An encoder's noise, or a push back, is less.
bool turns_back(const VectorXd& speed, double last) {
  constexpr double kAsFast = 0.5;
  const double other_way = last > 0.0 ? -speed.minCoeff() : speed.maxCoeff();
  return other_way >= kAsFast * std::abs(last);
}

// A speed that is gained within one sample is a first value that nobody measured.
std::optional<UndrivenGain> speed_that_stays(const VectorXd& speed) {
  constexpr double kPart = 0.1, kGained = 3.0;    // of the samples; times the speed
  constexpr double kStays = 0.5, kSteady = 0.25;  // of the largest; deviation of the mean
  const auto part = static_cast<Index>(kPart * static_cast<double>(speed.size()));
  const double last = speed.tail(part).mean();
  const double deviation = std::sqrt((speed.tail(part).array() - last).square().mean());
  if (!(std::abs(last) >= kStays * speed.cwiseAbs().maxCoeff()) || last == 0.0) return {};
  const bool begins_at_rest =
      std::abs(speed(0)) <= kLow * std::abs(last) && deviation <= kSteady * std::abs(last);
  const double first = begins_at_rest ? speed(0) : speed.head(part).mean();
  if (std::abs(last) < kGained * std::abs(first) || turns_back(speed, last)) return {};
  const double way = last > 0.0 ? 1.0 : -1.0, begin = way * first;
  const double gain = std::abs(last) - begin;
  UndrivenGain found{false, 0, 0, first, last};
  while (way * speed(found.last) < begin + kHigh * gain) {
    if (++found.last == speed.size()) return {};
    if (way * speed(found.last) <= begin + kLow * gain) found.first = found.last;
  }
  if (found.last - found.first < 2) return {};
  return found;
}

// Rest is told from a free passage of the middle by time: x = A sin(w t) stays below a twentieth of
// A for a ninth of the time in which it goes on to its half; 1 - cos(w t) for two fifths.
std::optional<UndrivenGain> place_that_is_left(const VectorXd& times, const VectorXd& place) {
  constexpr double kTail = 0.2, kAtRest = 0.1;                 // of the samples; of the largest way
  constexpr double kThere = 0.05, kHalf = 0.5, kWaits = 0.25;  // of it, twice; of the time
  constexpr Index kFewestAtRest = 3;
  const Index n = place.size();
  const VectorXd tail = place.tail(static_cast<Index>(kTail * static_cast<double>(n)));
  std::vector<double> sorted(tail.begin(), tail.end());
  std::ranges::sort(sorted);
  const VectorXd way = place.array() - quantile(sorted, 0.5);
  Index farthest = 0;
  const double most = way.cwiseAbs().maxCoeff(&farthest);
  if (!(most > 0.0) || sorted.back() - sorted.front() > kAtRest * most) return {};
  Index leaves = 0;
  while (std::abs(way(leaves)) <= kThere * most) ++leaves;
  if (leaves < kFewestAtRest) return {};
  Index half = leaves;
  while (std::abs(way(half)) < kHalf * most) ++half;
  const double waited = times(leaves - 1) - times(0), went = times(half) - times(leaves - 1);
  if (waited < kWaits * went) return {};
  Index back = farthest;
  while (back + 1 < n && way(back + 1) * (way(farthest) > 0.0 ? 1.0 : -1.0) >= kHigh * most) ++back;
  return UndrivenGain{true, leaves - 1, back, way(leaves - 1), way(farthest)};
}

}  // namespace

std::optional<UndrivenGain> find_undriven_gain(const VectorXd& times, const VectorXd& motion,
                                               bool is_velocity) {
  const bool is_usable = motion.size() >= kFewest && times.size() == motion.size() &&
                         motion.allFinite() && times.allFinite();
  if (!is_usable) return {};
  const VectorXd speed = is_velocity ? motion : rate_of(times, motion);
  if (const auto gain = speed_that_stays(speed)) return gain;
  return place_that_is_left(times, is_velocity ? place_of(times, motion) : motion);
}

}  // namespace graybox
