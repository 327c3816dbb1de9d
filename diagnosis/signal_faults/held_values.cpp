#include "diagnosis/signal_faults/held_values.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr std::size_t kFewestChanges = 12;
constexpr double kCommonest = 0.4;  // of the intervals
constexpr double kMultiples = 0.9;
constexpr double kOtherSizes = 0.1, kLarger = 1.5;
constexpr double kWhole = 0.02;  // of a step of resolution

struct Changes {
  std::vector<Index> samples;  // that differ from those before them
  std::vector<double> sizes;
  double smallest = std::numeric_limits<double>::infinity();
};

Changes changes_of(const Eigen::Ref<const Eigen::VectorXd>& values) {
  Changes changes;
  for (Index k = 1; k < values.size(); ++k) {
    const double size = std::abs(values(k) - values(k - 1));
    if (!(size > 0.0)) continue;
    changes.samples.push_back(k);
    changes.sizes.push_back(size);
    changes.smallest = std::min(changes.smallest, size);
  }
  return changes;
}

// The commonest interval between changes, if it is common enough; else 0.
Index usual_interval(const Changes& changes) {
  std::map<Index, std::size_t> counts;
  for (std::size_t k = 1; k < changes.samples.size(); ++k) {
    ++counts[changes.samples[k] - changes.samples[k - 1]];
  }
  const auto commonest = std::ranges::max_element(
      counts, [](const auto& a, const auto& b) { return a.second < b.second; });
  const auto intervals = static_cast<double>(changes.samples.size() - 1);
  if (static_cast<double>(commonest->second) < kCommonest * intervals) return 0;
  std::size_t multiples = 0;
  for (const auto& [interval, count] : counts) {
    if (interval % commonest->first == 0) multiples += count;
  }
  return static_cast<double>(multiples) < kMultiples * intervals ? 0 : commonest->first;
}

double resolution_of(const Changes& changes) {
  const bool all_whole = std::ranges::all_of(changes.sizes, [&](double size) {
    const double count = size / changes.smallest;
    return std::abs(count - std::round(count)) < kWhole;
  });
  return all_whole ? changes.smallest : 0.0;
}

}  // namespace

std::optional<HeldValues> find_held_values(const Eigen::Ref<const Eigen::VectorXd>& values) {
  if (values.size() < 2 || has_few_levels(values)) return {};
  const Changes changes = changes_of(values);
  if (changes.samples.size() < kFewestChanges) return {};
  const Index interval = usual_interval(changes);
  if (interval < 2) return {};
  const auto larger = std::ranges::count_if(
      changes.sizes, [&](double size) { return size > kLarger * changes.smallest; });
  if (static_cast<double>(larger) < kOtherSizes * static_cast<double>(changes.sizes.size())) {
    return {};
  }
  return HeldValues{
      interval, changes.samples.front(), resolution_of(changes),
      static_cast<double>(changes.samples.size()) / static_cast<double>(kFewestChanges)};
}

}  // namespace graybox
