#include "diagnosis/prediction_error/ripple_trials.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kFewestPeriods = 1.5, kStep = 0.25;  // within the range
constexpr double kMostPeriods = 300.0;
constexpr double kSamplesAPeriod = 8.0;  // at the ninth decile of the speed
// Of waves that come back so often that no spring looks like them, and then.
constexpr double kManyPeriods = 4.0, kSamplesOfMany = 4.0;
constexpr std::size_t kTrials = 2;
constexpr std::size_t kFewest = 100;  // samples

RippleTrial at_order(const VectorXd& force, const VectorXd& position, double frequency) {
  const Eigen::ArrayXd angle = 2.0 * std::numbers::pi * frequency * position.array();
  const VectorXd c = angle.cos(), s = angle.sin();
  const double n = static_cast<double>(force.size());
  const double cm = c.mean(), sm = s.mean();
  const double cc = c.squaredNorm() - n * cm * cm, ss = s.squaredNorm() - n * sm * sm;
  const double cs = c.dot(s) - n * cm * sm, cf = c.dot(force), sf = s.dot(force);
  const double determinant = cc * ss - cs * cs;
  RippleTrial trial;
  if (!(determinant > 1e-9 * cc * ss)) return trial;
  const double a = (ss * cf - cs * sf) / determinant, b = (cc * sf - cs * cf) / determinant;
  trial.period = 1.0 / frequency;
  trial.phase = std::atan2(a, b);
  trial.share = (a * cf + b * sf) / std::max(force.squaredNorm(), 1e-300);
  return trial;
}

// The way between two samples of fast motion.
double fast_step(const VectorXd& position, const std::vector<Index>& moving) {
  std::vector<double> steps;
  for (const Index k : moving) {
    if (k > 0) steps.push_back(std::abs(position(k) - position(k - 1)));
  }
  if (steps.empty()) return std::numeric_limits<double>::infinity();
  const auto ninth =
      steps.begin() + static_cast<std::ptrdiff_t>(0.9 * static_cast<double>(steps.size()));
  std::ranges::nth_element(steps, ninth);
  return *ninth;
}

// Whether a period has enough samples in fast motion.
bool is_sampled(double frequency, double step, double range) {
  const double samples = frequency * range >= kManyPeriods ? kSamplesOfMany : kSamplesAPeriod;
  return frequency * samples * step <= 1.0;
}

}  // namespace

std::vector<Index> moving_samples(const LatentForce& force) {
  constexpr double kStands = 0.01;
  const Index coordinates = force.motion.cols() / 2;
  const VectorXd speed = force.motion.col(coordinates + force.disturbance.coordinate).cwiseAbs();
  std::vector<Index> moving;
  const double least = kStands * speed.maxCoeff();
  for (Index k = 0; k < speed.size(); ++k) {
    if (force.settled[static_cast<std::size_t>(k)] != 0 && speed(k) > least) moving.push_back(k);
  }
  return moving;
}

std::vector<RippleTrial> ripple_trials(const LatentForce& force) {
  if (!force.usable) return {};
  const std::vector<Index> moving = moving_samples(force);
  if (moving.size() < kFewest) return {};
  const VectorXd all = force.motion.col(force.disturbance.coordinate);
  const VectorXd position = all(moving);
  VectorXd pushed = force.force(moving);
  pushed.array() -= pushed.mean();
  const double range = position.maxCoeff() - position.minCoeff();
  if (!(range > 0.0)) return {};
  const double step = fast_step(all, moving);
  std::vector<RippleTrial> grid;
  for (double f = kFewestPeriods / range; f <= kMostPeriods / range; f += kStep / range) {
    if (is_sampled(f, step, range)) grid.push_back(at_order(pushed, position, f));
  }
  std::ranges::stable_sort(grid, std::greater{}, &RippleTrial::share);
  std::vector<RippleTrial> best;
  for (RippleTrial& trial : grid) {
    const bool is_apart = std::ranges::none_of(best, [&](const RippleTrial& other) {
      return std::abs(1.0 / other.period - 1.0 / trial.period) < 1.0 / range;
    });
    if (!(trial.share > 0.0) || !is_apart) continue;
    trial.coordinate = force.disturbance.coordinate;
    best.push_back(trial);
    if (best.size() == kTrials) break;
  }
  return best;
}

}  // namespace graybox
