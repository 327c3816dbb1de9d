#include "diagnosis/recordings/signal_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kWildSpreads = 20.0;  // median absolute deviations
constexpr double kWildSteps = 10.0;
constexpr double kLargestValue = 1e50;
constexpr Index kFlatRun = 4;
constexpr std::size_t kFlatRuns = 2;
constexpr Index kLongRun = 10;  // one is enough where samples hardly ever repeat

struct StepSizes {
  double rms = 0.0;
  double smallest = HUGE_VAL;  // that is not zero
};

StepSizes step_sizes(const Eigen::Ref<const Eigen::VectorXd>& values) {
  StepSizes sizes;
  for (Index k = 1; k < values.size(); ++k) {
    const double step = std::abs(values(k) - values(k - 1));
    sizes.rms += step * step;
    if (step > 0.0) sizes.smallest = std::min(sizes.smallest, step);
  }
  sizes.rms = std::sqrt(sizes.rms / static_cast<double>(values.size() - 1));
  return sizes;
}

// Whether what goes to the limit at sample k is about to stop by itself: its last steps, as they
// fall, come to less than 0.6 of the last one. A machine that turns round stands still there; a
// signal that is cut goes on.
bool is_stopping(const Eigen::Ref<const Eigen::VectorXd>& values, double limit, Index k) {
  constexpr double kSlower = 0.6;
  if (k < 3) return false;
  const double way = limit > values(k - 1) ? 1.0 : -1.0;
  const double last = way * (values(k - 1) - values(k - 2)),
               before = way * (values(k - 2) - values(k - 3));
  return last > 0.0 && last + (last - before) < kSlower * last;
}

// The flat runs at one value.
struct FlatTops {
  std::vector<Index> samples;
  std::size_t runs = 0;
  Index longest = 0;
  bool entered_abruptly = false;
};

FlatTops flat_tops_at(const Eigen::Ref<const Eigen::VectorXd>& values, double limit,
                      const StepSizes& sizes) {
  const double abrupt = std::max(0.1 * sizes.rms, 2.0 * sizes.smallest);
  FlatTops tops;
  for (Index k = 0; k < values.size();) {
    Index end = k;
    while (end < values.size() && values(end) == limit) ++end;
    if (end - k >= kFlatRun) {
      ++tops.runs;
      tops.longest = std::max(tops.longest, end - k);
      for (Index at = k; at < end; ++at) tops.samples.push_back(at);
      const bool is_abrupt = k > 0 && std::abs(limit - values(k - 1)) > abrupt;
      tops.entered_abruptly |= is_abrupt && !is_stopping(values, limit, k);
    }
    k = end + 1;
  }
  return tops;
}

// Whether two samples on end hardly ever have one value, but at the limits: noise or motion tells
// them apart. Then one long run is no chance.
bool hardly_repeats(const Eigen::Ref<const Eigen::VectorXd>& values, double lowest,
                    double highest) {
  constexpr double kHardly = 0.1;
  Index pairs = 0, equal = 0;
  for (Index k = 1; k < values.size(); ++k) {
    if (values(k) == lowest || values(k) == highest) continue;
    ++pairs;
    if (values(k) == values(k - 1)) ++equal;
  }
  return pairs > 0 && static_cast<double>(equal) < kHardly * static_cast<double>(pairs);
}

}  // namespace

std::vector<Index> wild_samples(const Eigen::Ref<const Eigen::VectorXd>& values) {
  std::vector<Index> wild;
  const Index size = values.size();
  if (size < 3 || has_few_levels(values)) return wild;
  const double median = quantile(values, 0.5);
  const double spread = quantile((values.array() - median).abs(), 0.5);
  const double step = quantile(steps_of(values).cwiseAbs(), 0.95);
  for (Index k = 1; k + 1 < size; ++k) {
    const double distance = std::abs(values(k) - median);
    if (distance <= kWildSpreads * spread) continue;
    const double rise = values(k) - values(k - 1);
    const double fall = values(k) - values(k + 1);
    const double both = rise * fall > 0.0 ? std::min(std::abs(rise), std::abs(fall)) : 0.0;
    if (both > 0.5 * distance && both > kWildSteps * step) wild.push_back(k);
  }
  return wild;
}

std::vector<Index> clipped_places(const Eigen::Ref<const Eigen::VectorXd>& values) {
  std::vector<Index> places;
  if (values.size() < 2 || has_few_levels(values)) return places;
  const StepSizes sizes = step_sizes(values);
  const double lowest = values.minCoeff(), highest = values.maxCoeff();
  const FlatTops low = flat_tops_at(values, lowest, sizes),
                 high = flat_tops_at(values, highest, sizes);
  const bool is_rare = hardly_repeats(values, lowest, highest);
  // Two limits that differ by their sign alone are one limit.
  const std::size_t of_both = lowest == -highest && is_rare ? low.runs + high.runs : 0;
  const auto add = [&](const FlatTops& tops, double limit) {
    const bool is_long = is_rare && tops.longest >= kLongRun && limit != 0.0;  // 0: at rest
    const bool is_enough = std::max(tops.runs, of_both) >= kFlatRuns || is_long;
    if (!is_enough || !tops.entered_abruptly) return;
    places.insert(places.end(), tops.samples.begin(), tops.samples.end());
  };
  add(high, highest);
  add(low, lowest);
  return places;
}

std::size_t clipped_samples(const Eigen::Ref<const Eigen::VectorXd>& values) {
  return clipped_places(values).size();
}

void check_signal(const std::string& source, const Eigen::Ref<const Eigen::VectorXd>& values,
                  const std::optional<std::pair<double, double>>& range, std::size_t offset,
                  std::vector<Finding>& findings) {
  const auto add = [&](Severity severity, const char* check, const std::string& text) {
    findings.push_back({severity, check, fmt::format("{}: {}", source, text)});
  };
  const auto finite = [](double value) { return std::isfinite(value); };
  if (!values.allFinite()) {
    const auto first = std::find_if_not(values.begin(), values.end(), finite) - values.begin();
    const auto count = values.size() - std::count_if(values.begin(), values.end(), finite);
    add(Severity::kError, "not a number",
        fmt::format("{} of {} samples are not finite, the first is sample {}; repair them or use "
                    "segments without them",
                    count, values.size(), static_cast<std::size_t>(first) + offset));
    return;
  }
  Index largest = 0;
  if (values.cwiseAbs().maxCoeff(&largest) > kLargestValue) {
    add(Severity::kError, "too large",
        fmt::format("sample {} is {:g}: no measurement is beyond {:g}; repair it or use segments "
                    "without it",
                    static_cast<std::size_t>(largest) + offset, values(largest), kLargestValue));
    return;
  }
  const double lowest = values.minCoeff();
  const double highest = values.maxCoeff();
  if (lowest == highest) {
    add(Severity::kWarning, "constant", fmt::format("is {:g} throughout", lowest));
  } else if (range) {
    const auto count = (values.array() <= range->first || values.array() >= range->second).count();
    if (count > 0) {
      add(Severity::kWarning, "clipped",
          fmt::format("{} of {} samples are at or beyond the range [{:g}, {:g}]", count,
                      values.size(), range->first, range->second));
    }
  } else if (const std::size_t count = clipped_samples(values); count > 0) {
    add(Severity::kWarning, "clipped",
        fmt::format(
            "{} of {} samples lie in flat tops at {:g} or {:g}: a sensor or drive that ends "
            "there (state its range), or what stood still or was off",
            count, values.size(), lowest, highest));
  }
}

}  // namespace graybox
