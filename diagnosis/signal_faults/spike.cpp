#include "diagnosis/signal_faults/spike.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kFewest = 100;
constexpr double kNoise = 12.0 * 1.4826;  // medians of the distance
constexpr double kSteps = 8.0;
constexpr double kAlmostAll = 0.999;
constexpr double kMost = 0.99;       // keep below: a few spikes are not among them
constexpr double kMoving = 0.9;      // of the samples that do not fit exactly
constexpr double kMisfits = 16.0;    // of such samples
constexpr double kBesideMost = 6.0;  // times what is left of it beside a spike that is mended
constexpr Index kReach = 2;          // samples on each side of a cubic
constexpr double kRounding = 1e-6;
constexpr Index kStart =
    3;  // samples at the start, where a controller that is switched on may kick

// A sample less the cubic through two on each side of it.
double misfit(const Eigen::Ref<const Eigen::VectorXd>& values, Index k) {
  return values(k) - (4.0 * (values(k - 1) + values(k + 1)) - values(k - 2) - values(k + 2)) / 6.0;
}

// What most samples misfit their cubic by; a signal that stands for long is asked where it moves.
double usual_misfit(const Eigen::Ref<const Eigen::VectorXd>& misfits) {
  const Eigen::VectorXd sizes = misfits.cwiseAbs();
  std::vector<double> moving;
  for (const double size : sizes) {
    if (size > 0.0) moving.push_back(size);
  }
  if (moving.empty()) return 0.0;
  const Eigen::Map<const Eigen::VectorXd> of_moving(moving.data(),
                                                    static_cast<Index>(moving.size()));
  return std::max(quantile(sizes, kMost), quantile(of_moving, kMoving));
}

// Whether the samples beside it fit once this one is put on its cubic. A jump's do not.
bool stands_alone(const Eigen::Ref<const Eigen::VectorXd>& values, Index k, double size) {
  Eigen::VectorXd around = values.segment(k - 2 * kReach, 4 * kReach + 1);
  around(2 * kReach) -= misfit(around, 2 * kReach);
  for (Index i = kReach; i <= 3 * kReach; ++i) {
    if (kBesideMost * std::abs(misfit(around, i)) >= size) return false;
  }
  return true;
}

// Single samples in a smooth signal. Its steps may be as large: a sine's are.
std::vector<Spike> spikes_in_smooth(const Eigen::Ref<const Eigen::VectorXd>& values) {
  Eigen::VectorXd misfits = Eigen::VectorXd::Zero(values.size());
  for (Index k = kReach; k + kReach < values.size(); ++k) misfits(k) = misfit(values, k);
  const double threshold =
      std::max(kMisfits * usual_misfit(misfits), kRounding * values.cwiseAbs().maxCoeff());
  std::vector<Spike> spikes;
  for (Index k = 2 * kReach; k + 2 * kReach < values.size(); ++k) {
    const double size = std::abs(misfits(k));
    if (size <= threshold || !stands_alone(values, k, size)) continue;
    spikes.push_back({k, size / threshold});
  }
  return spikes;
}

bool is_earlier(const Spike& one, const Spike& other) { return one.sample < other.sample; }

// Both lists in order; of a sample in both the stronger.
std::vector<Spike> joined(const std::vector<Spike>& one, const std::vector<Spike>& other) {
  std::vector<Spike> all;
  std::ranges::merge(one, other, std::back_inserter(all), is_earlier);
  std::vector<Spike> spikes;
  for (const Spike& spike : all) {
    if (!spikes.empty() && spikes.back().sample == spike.sample) {
      spikes.back().strength = std::max(spikes.back().strength, spike.strength);
    } else {
      spikes.push_back(spike);
    }
  }
  return spikes;
}

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
  return joined(spikes, spikes_in_smooth(values));
}

}  // namespace graybox
