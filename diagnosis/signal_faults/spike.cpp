#include "diagnosis/signal_faults/spike.hpp"

#include <algorithm>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kFewest = 100;
constexpr double kNoise = 12.0 * 1.4826;  // medians of the distance
constexpr double kSteps = 8.0;
constexpr double kAlmostAll = 0.999;
constexpr double kRounding = 1e-6;
constexpr Index kStart =
    3;  // samples at the start, where a controller that is switched on may kick

}  // namespace

std::vector<Spike> find_spikes(const Eigen::Ref<const Eigen::VectorXd>& values) {
  std::vector<Spike> spikes;
  if (values.size() < kFewest || has_few_levels(values)) return spikes;
  const Eigen::VectorXd medians = running_median(values);
  const Eigen::VectorXd distance = (values - medians).cwiseAbs();
  const double largest_step = quantile(steps_of(medians).cwiseAbs(), kAlmostAll);
  const double threshold = std::max({kNoise * quantile(distance, 0.5), kSteps * largest_step,
                                     kRounding * values.cwiseAbs().maxCoeff()});
  for (Index k = kStart; k < values.size(); ++k) {
    if (distance(k) > threshold) spikes.push_back({k, distance(k) / threshold});
  }
  return spikes;
}

}  // namespace graybox
