#include "bench/any_motion_challenge/motion_reference.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace graybox::bench {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// A target that is new: at least a fifth of the range away.
double next_target(double from, Random& random) {
  for (;;) {
    const double target = random.uniform(-1.0, 1.0);
    if (std::abs(target - from) > 0.4) return target;
  }
}

Index samples_of(double time, double sample_time) {
  return std::max<Index>(1, static_cast<Index>(std::lround(time / sample_time)));
}

VectorXd steps(Index samples, double sample_time, double shortest, double longest, Random& random) {
  VectorXd r = VectorXd::Zero(samples);
  double target = 0.0;
  for (Index k = samples_of(0.1, sample_time); k < samples;) {
    target = next_target(target, random);
    const Index held = samples_of(random.uniform(shortest, longest), sample_time);
    for (const Index end = std::min(k + held, samples); k < end; ++k) r(k) = target;
  }
  return r;
}

// The share of the way at the share t of the time, a quarter each of speeding up and braking.
double trapezoid(double t) {
  constexpr double kRamp = 0.25, kRate = 1.0 / (1.0 - kRamp);
  if (t < kRamp) return 0.5 * kRate * t * t / kRamp;
  if (t > 1.0 - kRamp) return 1.0 - 0.5 * kRate * (1.0 - t) * (1.0 - t) / kRamp;
  return kRate * (t - 0.5 * kRamp);
}

VectorXd work_cycle(Index samples, double sample_time, Random& random) {
  VectorXd r = VectorXd::Zero(samples);
  double from = 0.0;
  for (Index k = samples_of(0.1, sample_time); k < samples;) {
    const double to = next_target(from, random);
    const double speed = random.uniform(1.5, 3.0);
    const Index moving = samples_of(std::abs(to - from) / speed, sample_time);
    for (Index i = 0; i < moving && k < samples; ++i, ++k) {
      r(k) =
          from + (to - from) * trapezoid(static_cast<double>(i + 1) / static_cast<double>(moving));
    }
    const Index standing = samples_of(random.uniform(0.2, 0.6), sample_time);
    for (const Index end = std::min(k + standing, samples); k < end; ++k) r(k) = to;
    from = to;
  }
  return r;
}

VectorXd smooth(Index samples, double sample_time, Random& random) {
  VectorXd r = VectorXd::Zero(samples);
  constexpr int kSines = 8;
  for (int s = 0; s < kSines; ++s) {
    const double frequency = 0.15 * std::pow(4.0 / 0.15, (s + random.uniform()) / kSines);
    const double amplitude = 0.5 / std::sqrt(frequency / 0.15);
    const double phase = random.uniform(0.0, 2.0 * std::numbers::pi);
    for (Index k = 0; k < samples; ++k) {
      const double t = static_cast<double>(k) * sample_time;
      r(k) +=
          amplitude * (std::sin(2.0 * std::numbers::pi * frequency * t + phase) - std::sin(phase));
    }
  }
  return r / std::max(1.0, r.cwiseAbs().maxCoeff());
}

VectorXd random_targets(Index samples, double sample_time, Random& random) {
  VectorXd r = steps(samples, sample_time, 0.3, 0.8, random);
  const double share = -std::expm1(-sample_time / 0.08);
  double first = 0.0, second = 0.0;
  for (Index k = 0; k < samples; ++k) {
    first += share * (r(k) - first);
    second += share * (first - second);
    r(k) = second;
  }
  return r;
}

}  // namespace

VectorXd motion_reference(MotionKind kind, Index samples, double sample_time, Random& random) {
  switch (kind) {
    case MotionKind::kSteps:
      return steps(samples, sample_time, 0.4, 1.0, random);
    case MotionKind::kWorkCycle:
      return work_cycle(samples, sample_time, random);
    case MotionKind::kSmooth:
      return smooth(samples, sample_time, random);
    default:
      return random_targets(samples, sample_time, random);
  }
}

}  // namespace graybox::bench
