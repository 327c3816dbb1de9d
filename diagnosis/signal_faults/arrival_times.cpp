#include "diagnosis/signal_faults/arrival_times.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "diagnosis/signal_faults/sample_statistics.hpp"
#include "diagnosis/signal_faults/time_axis.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kFewest = 100;
constexpr double kLongestStep = 1.9;  // medians: beyond, samples may have been lost

// Sample k less what its four neighbours say, if samples were taken at `at` (relative to k).
double left_out_error(const Eigen::Ref<const Eigen::VectorXd>& values, Index k,
                      const std::array<double, 4>& at) {
  constexpr std::array<Index, 4> kNeighbours{-2, -1, 1, 2};
  double sum = 0.0;
  for (std::size_t i = 0; i < at.size(); ++i) {
    double weight = 1.0;
    for (std::size_t j = 0; j < at.size(); ++j) {
      if (j != i) weight *= at[j] / (at[j] - at[i]);
    }
    sum += weight * values(k + kNeighbours[i]);
  }
  return std::abs(values(k) - sum);
}

double median(const std::vector<double>& values) {
  return quantile(Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values)), 0.5);
}

}  // namespace

std::optional<ArrivalTimes> find_arrival_times(const Eigen::Ref<const Eigen::VectorXd>& time,
                                               const Eigen::Ref<const Eigen::VectorXd>& position) {
  const Index samples = position.size();
  if (samples < kFewest || has_few_levels(position)) return {};
  const TimeAxis axis = examine_times(time);
  const bool has_lost_samples = axis.longest > kLongestStep * axis.step;
  if (axis.kind == TimeAxis::Kind::kEven || axis.kind == TimeAxis::Kind::kUnordered ||
      has_lost_samples) {
    return {};
  }
  const Eigen::VectorXd travel =
      (position.tail(samples - 4) - position.head(samples - 4)).cwiseAbs();
  const double least = quantile(travel, 0.5);
  std::vector<double> by_times, as_even;
  for (Index k = 2; k < samples - 2; ++k) {
    if (!(travel(k - 2) > least)) continue;
    by_times.push_back(left_out_error(position, k,
                                      {time(k - 2) - time(k), time(k - 1) - time(k),
                                       time(k + 1) - time(k), time(k + 2) - time(k)}));
    as_even.push_back(left_out_error(position, k, {-2.0, -1.0, 1.0, 2.0}));
  }
  if (by_times.empty()) return {};
  const double even = median(as_even), strength = kSmoother * median(by_times);
  if (!(strength > even)) return {};
  const double step = (time(samples - 1) - time(0)) / static_cast<double>(samples - 1);
  constexpr double kMost = 1e6;
  return ArrivalTimes{step, even > 0.0 ? std::min(strength / even, kMost) : kMost};
}

}  // namespace graybox
