#include "diagnosis/signal_faults/stuck_sensor.hpp"

#include <algorithm>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kFewest = 100;
constexpr Index kShortest = 20;
constexpr Index kBefore = 5;  // steps
constexpr double kJump = 5.0;
constexpr double kMotion = 0.5;

// The run that begins at `first` and ends before `end`; its strength is 0 if nothing is odd about
// it.
StuckRun run_of(const Eigen::VectorXd& steps, Index first, Index end, double jump, double motion) {
  const double after = std::abs(steps(end - 1)) / jump;
  if (after > 1.0) return {first, end - 1, after, true};
  if (first < kBefore) return {first, end - 1, 0.0, false};
  const double before = steps.segment(first - kBefore, kBefore).cwiseAbs().minCoeff() / motion;
  return {first, end - 1, before > 1.0 ? before : 0.0, false};
}

// Whether a signal trembles: two samples on end are hardly ever equal, but in the run, and steps
// turn round as those of noise do.
bool trembles(const Eigen::VectorXd& steps, Index first, Index end) {
  constexpr double kHardly = 0.02, kOften = 0.3;
  Index count = 0, equal = 0, turns = 0;
  for (Index k = 1; k < steps.size(); ++k) {
    if (k >= first && k <= end) continue;
    ++count;
    if (steps(k) == 0.0) ++equal;
    if (steps(k) * steps(k - 1) < 0.0) ++turns;
  }
  const auto all = static_cast<double>(count);
  if (static_cast<double>(equal) >= kHardly * all) return false;
  return static_cast<double>(turns) > kOften * all;
}

}  // namespace

std::optional<StuckRun> find_stuck_run(const Eigen::Ref<const Eigen::VectorXd>& values,
                                       Index shortest) {
  if (values.size() < kFewest || has_few_levels(values)) return {};
  const Eigen::VectorXd steps = steps_of(values);
  const double jump = kJump * quantile(steps.cwiseAbs(), 0.99);
  const double motion = kMotion * quantile(steps.cwiseAbs(), 0.9);
  if (!(jump > 0.0) || !(motion > 0.0)) return {};
  const double lowest = values.minCoeff(), highest = values.maxCoeff();
  std::optional<StuckRun> longest;
  for (Index first = 0, end = 0; first < values.size(); first = end) {
    for (end = first + 1; end < values.size() && values(end) == values(first);) ++end;
    const Index count = end - first;
    const bool inside = first > 0 && end < values.size();
    if (!inside || count < std::max(shortest, kShortest)) continue;
    if (values(first) == lowest || values(first) == highest) continue;
    if (longest && count <= longest->last - longest->first + 1) continue;
    StuckRun run = run_of(steps, first, end, jump, motion);
    // Zero is rest.
    if (!(run.strength > 0.0) && values(first) != 0.0 && trembles(steps, first, end)) {
      run.strength = static_cast<double>(count) / static_cast<double>(kShortest);
    }
    if (run.strength > 0.0) longest = run;
  }
  return longest;
}

}  // namespace graybox
