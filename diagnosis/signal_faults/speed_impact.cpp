#include "diagnosis/signal_faults/speed_impact.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kFewestOfSpeed = 100;
constexpr double kOfRange = 0.25, kOfSteps = 8.0, kMostSteps = 0.95, kBack = 0.1;

bool turns_for_good(const Eigen::Ref<const Eigen::VectorXd>& v, Eigen::Index k) {
  return v(k) * v(k - 1) < 0.0 && v(k - 1) * v(k - 2) > 0.0 && v(k) * v(k + 1) > 0.0 &&
         std::abs(v(k)) >= kBack * std::abs(v(k - 1));
}

}  // namespace

std::optional<SpeedImpacts> find_speed_impacts(const Eigen::Ref<const Eigen::VectorXd>& velocity) {
  if (velocity.size() < kFewestOfSpeed || has_few_levels(velocity)) return {};
  const Eigen::VectorXd steps = steps_of(velocity).cwiseAbs();
  const double threshold = std::max(kOfRange * (velocity.maxCoeff() - velocity.minCoeff()),
                                    kOfSteps * quantile(steps, kMostSteps));
  SpeedImpacts impacts{.first = 0, .count = 0, .largest = 0.0, .strength = 0.0};
  for (Eigen::Index k = 2; k + 1 < velocity.size(); ++k) {
    if (!(steps(k - 1) >= threshold) || !turns_for_good(velocity, k)) continue;
    if (impacts.count++ == 0) impacts.first = k;
    impacts.largest = std::max(impacts.largest, steps(k - 1));
  }
  if (impacts.count == 0) return {};
  impacts.strength = impacts.largest / threshold;
  return impacts;
}

}  // namespace graybox
