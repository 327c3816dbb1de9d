#include "diagnosis/signal_faults/lost_samples.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kFewest = 100;
constexpr double kJump = 20.0;
constexpr Index kEnds = 2;          // steps
constexpr double kComesBack = 0.5;  // of the jump, within two steps

bool comes_back(const Eigen::VectorXd& rest, Index k) {
  const Index first = std::max<Index>(0, k - 2), last = std::min(rest.size() - 1, k + 2);
  for (Index other = first; other <= last; ++other) {
    if (rest(other) * rest(k) < 0.0 && std::abs(rest(other)) > kComesBack * std::abs(rest(k))) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::optional<LostSamples> find_lost_samples(const Eigen::Ref<const Eigen::VectorXd>& time,
                                             const Eigen::Ref<const Eigen::VectorXd>& position) {
  if (position.size() < kFewest || has_few_levels(position)) return {};
  const Eigen::VectorXd steps = steps_of(position);
  const Eigen::VectorXd rates = steps.cwiseQuotient(steps_of(time));
  const Eigen::VectorXd rest = rates - running_median(rates);
  const double threshold = kJump * quantile(rest.cwiseAbs(), 0.99);
  if (!(threshold > 0.0)) return {};
  std::optional<LostSamples> found;
  for (Index k = kEnds; k < rest.size() - kEnds; ++k) {
    const double strength = std::abs(rest(k)) / threshold;
    if (strength <= 1.0 || comes_back(rest, k)) continue;
    if (!found) found = LostSamples{{}, steps(k), strength};
    found->after.push_back(k + 1);
    found->strength = std::max(found->strength, strength);
  }
  return found;
}

std::optional<StaleStart> find_stale_start(const Eigen::Ref<const Eigen::VectorXd>& values) {
  constexpr Index kFewestSamples = 50, kMostStale = 2;
  constexpr double kTimesLargest = 8.0;
  if (values.size() < kFewestSamples || has_few_levels(values)) return {};
  const Eigen::VectorXd steps = steps_of(values).cwiseAbs();
  for (Index stale = kMostStale; stale > 0; --stale) {
    const double largest = steps.tail(steps.size() - stale).maxCoeff();
    const double threshold = kTimesLargest * largest;
    if (!(largest > 0.0) || steps(stale - 1) <= threshold) continue;
    return StaleStart{stale, steps(stale - 1) / threshold};
  }
  return {};
}

bool may_have_set_off(const Eigen::Ref<const Eigen::VectorXd>& speed, const StaleStart& start) {
  const double before = speed(start.samples - 1), behind = speed(start.samples);
  return before * behind >= 0.0 && std::abs(before) < std::abs(behind);
}

}  // namespace graybox
