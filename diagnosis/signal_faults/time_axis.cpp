#include "diagnosis/signal_faults/time_axis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kEvenTolerance = 0.01;  // of a step
constexpr double kUsableJitter = 0.1;    // of a step
constexpr double kGap = 1.5;             // steps
constexpr double kLongStep = 5.0;        // medians, in irregular recordings
constexpr double kSameRate = 0.05;       // of a step
constexpr double kMixedShare = 0.05;     // of all steps
constexpr double kStretch = 10.0;        // steps

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// Largest distance from the straight line through the first and the last time, in steps.
double distance_from_even(const Eigen::Ref<const Eigen::VectorXd>& times) {
  const Index last = times.size() - 1;
  const double step = (times(last) - times(0)) / static_cast<double>(last);
  const Eigen::ArrayXd line =
      times(0) + step * Eigen::ArrayXd::LinSpaced(times.size(), 0.0, static_cast<double>(last));
  return (times.array() - line).abs().maxCoeff() / step;
}

// Another step than the median, in stretches.
void examine_rates(const Eigen::VectorXd& steps, TimeAxis& axis) {
  std::vector<double> others;
  std::size_t stretches = 0;
  std::size_t first = 0;
  bool inside = false;
  for (Index k = 0; k < steps.size(); ++k) {
    const bool other = std::abs(steps(k) - axis.step) > 0.2 * axis.step;
    if (other && others.empty()) first = static_cast<std::size_t>(k);
    if (other && !inside) ++stretches;
    if (other) others.push_back(steps(k));
    inside = other;
  }
  const auto count = static_cast<double>(others.size());
  if (count < kMixedShare * static_cast<double>(steps.size()) ||
      count < kStretch * static_cast<double>(std::max<std::size_t>(stretches, 1))) {
    return;
  }
  const double step = median(others);
  const auto alike = std::ranges::count_if(
      others, [&](double other) { return std::abs(other - step) <= kSameRate * step; });
  if (static_cast<double>(alike) < 0.9 * count) return;
  axis.kind = TimeAxis::Kind::kMixedRates;
  axis.other_step = step;
  axis.first = first;
}

void examine_gaps(const Eigen::VectorXd& steps, TimeAxis& axis) {
  bool near = true;
  for (Index k = 0; k < steps.size(); ++k) {
    if (steps(k) > kGap * axis.step) {
      if (axis.count++ == 0) axis.first = static_cast<std::size_t>(k);
      continue;
    }
    const double deviation = std::abs(steps(k) - axis.step) / axis.step;
    axis.jitter = std::max(axis.jitter, deviation);
    near = near && deviation <= 0.5;
  }
  const bool single =
      static_cast<double>(axis.count) <= kMixedShare * static_cast<double>(steps.size());
  if (!near || !single) {
    axis.kind = TimeAxis::Kind::kIrregular;
  } else {
    axis.kind = axis.count > 0 ? TimeAxis::Kind::kGaps : TimeAxis::Kind::kJittered;
  }
}

class TimeReport {
 public:
  TimeReport(const std::string& source, const Eigen::Ref<const Eigen::VectorXd>& times,
             std::size_t offset, std::vector<Finding>& findings)
      : source_(source), times_(times), offset_(offset), findings_(findings) {}

  void add(Severity severity, const std::string& text) const {
    findings_.push_back({severity, "time", fmt::format("{}: {}", source_, text)});
  }
  std::string place(std::size_t sample) const {
    return fmt::format("after sample {} ({:.6g} s)", sample + offset_,
                       times_(static_cast<Index>(sample)));
  }

 private:
  const std::string& source_;
  const Eigen::Ref<const Eigen::VectorXd>& times_;
  std::size_t offset_;
  std::vector<Finding>& findings_;
};

constexpr const char* kIfTrue =
    "if these times are true, write sample_time: irregular; if they are rounded, time: ignore";

void report_uneven(const TimeReport& report, const TimeAxis& axis) {
  switch (axis.kind) {
    case TimeAxis::Kind::kGaps:
      report.add(Severity::kError,
                 fmt::format("{} gap{}, the first {}, the longest {:.4g} s; use segments between "
                             "the gaps",
                             axis.count, axis.count == 1 ? "" : "s", report.place(axis.first),
                             axis.longest));
      return;
    case TimeAxis::Kind::kMixedRates:
      report.add(Severity::kError,
                 fmt::format("two sample rates: steps of {:.6g} s, and of {:.6g} s {}; split the "
                             "recording",
                             axis.step, axis.other_step, report.place(axis.first)));
      return;
    case TimeAxis::Kind::kJittered: {
      const bool usable = axis.jitter <= kUsableJitter;
      report.add(usable ? Severity::kWarning : Severity::kError,
                 fmt::format("times are up to {:.2g} % of a step of {:.6g} s off even ones; {}",
                             100.0 * axis.jitter, axis.step,
                             usable ? "samples are taken as even" : kIfTrue));
      return;
    }
    default:
      report.add(Severity::kError,
                 fmt::format("samples are not even: steps from {:.4g} s to {:.4g} s; {}",
                             axis.shortest, axis.longest, kIfTrue));
  }
}

}  // namespace

TimeAxis examine_times(const Eigen::Ref<const Eigen::VectorXd>& times) {
  const Eigen::VectorXd steps = times.tail(times.size() - 1) - times.head(times.size() - 1);
  TimeAxis axis{.step = median({steps.begin(), steps.end()}),
                .shortest = steps.minCoeff(),
                .longest = steps.maxCoeff()};
  if (axis.shortest <= 0.0) {
    axis.kind = TimeAxis::Kind::kUnordered;
    const auto back = std::find_if(steps.begin(), steps.end(), [](double s) { return s <= 0.0; });
    axis.first = static_cast<std::size_t>(back - steps.begin());
    axis.count = static_cast<std::size_t>((steps.array() <= 0.0).count());
    return axis;
  }
  const double distance = distance_from_even(times);
  if (distance <= kEvenTolerance) return axis;
  examine_rates(steps, axis);
  if (axis.kind == TimeAxis::Kind::kEven) examine_gaps(steps, axis);
  // Small steps off add up: a clock that drifts is as uneven as one that jumps.
  if (axis.kind == TimeAxis::Kind::kJittered) axis.jitter = std::max(axis.jitter, distance);
  return axis;
}

void check_times(const std::string& source, const Eigen::Ref<const Eigen::VectorXd>& times,
                 std::optional<double> sample_time, std::size_t offset,
                 std::vector<Finding>& findings) {
  const TimeReport report(source, times, offset, findings);
  if (!times.allFinite()) {
    report.add(Severity::kError, "a time is not a number; use segments without it");
    return;
  }
  if (times.size() < 2) return;
  const TimeAxis axis = examine_times(times);
  if (axis.kind == TimeAxis::Kind::kUnordered) {
    report.add(
        Severity::kError,
        fmt::format("times don't rise {} and at {} places in all; time stamps may be rounded "
                    "or the unit wrong",
                    report.place(axis.first), axis.count));
    return;
  }
  if (!sample_time) {
    if (axis.longest > kLongStep * axis.step) {
      report.add(Severity::kWarning,
                 fmt::format("the longest step is {:.4g} s, the median {:.4g} s", axis.longest,
                             axis.step));
    }
    return;
  }
  if (axis.kind != TimeAxis::Kind::kEven) report_uneven(report, axis);
  const bool steady = axis.kind == TimeAxis::Kind::kEven || axis.kind == TimeAxis::Kind::kJittered;
  const double step =
      steady ? (times(times.size() - 1) - times(0)) / static_cast<double>(times.size() - 1)
             : axis.step;
  const double tolerance = times.size() < 1000 ? 0.01 : 0.001;
  if (std::abs(step - *sample_time) > tolerance * *sample_time) {
    report.add(Severity::kError,
               fmt::format("samples are {:.6g} s apart, but sample_time is {:.6g} s; correct "
                           "sample_time or the unit of time",
                           step, *sample_time));
  }
}

}  // namespace graybox
