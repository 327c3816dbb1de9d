#include "diagnosis/signal_faults/sample_statistics.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <set>

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr std::size_t kFewLevels = 16;
constexpr Index kWindow = 5;

}  // namespace

double quantile(Eigen::VectorXd values, double share) {
  const auto rank = static_cast<Index>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values(rank);
}

Eigen::VectorXd steps_of(const Eigen::Ref<const Eigen::VectorXd>& values) {
  return values.tail(values.size() - 1) - values.head(values.size() - 1);
}

Eigen::VectorXd running_median(const Eigen::Ref<const Eigen::VectorXd>& values) {
  Eigen::VectorXd medians(values.size());
  for (Index k = 0; k < values.size(); ++k) {
    const Index first = std::clamp<Index>(k - kWindow / 2, 0, values.size() - kWindow);
    std::array<double, kWindow> window;
    std::copy_n(values.begin() + first, kWindow, window.begin());
    std::nth_element(window.begin(), window.begin() + kWindow / 2, window.end());
    medians(k) = window[kWindow / 2];
  }
  return medians;
}

bool has_few_levels(const Eigen::Ref<const Eigen::VectorXd>& values) {
  std::set<double> seen;
  for (const double value : values) {
    seen.insert(value);
    if (seen.size() > kFewLevels) return false;
  }
  return true;
}

}  // namespace graybox
