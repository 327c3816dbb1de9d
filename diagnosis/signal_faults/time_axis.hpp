// What the recorded times say: even samples, jitter, gaps, two rates, or no order at all.
//
//   const TimeAxis axis = examine_times(times);
//   if (axis.kind == TimeAxis::Kind::kGaps) ...    // axis.first is the sample before the first gap
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/signal_faults/finding.hpp"

namespace graybox {

// Steps are compared with their median m; "even" allows 1 % of m from the straight line through the
// first and the last time (the rounding of time stamps).
struct TimeAxis {
  enum class Kind {
    kEven,
    kJittered,    // all steps within m/2 of m
    kGaps,        // single steps above 1.5 m, the others within m/2 of m
    kMixedRates,  // stretches of at least ten equal steps that are not m, 5 % of all or more
    kIrregular,   // none of these
    kUnordered    // a time equal to the one before it or earlier
  };
  Kind kind = Kind::kEven;
  double step = 0.0;  // s, median
  double shortest = 0.0;
  double longest = 0.0;
  double jitter = 0.0;      // largest |step - m|/m but for gaps; of kJittered also the largest
                            // distance from even times, in steps
  std::size_t count = 0;    // of gaps, or of steps backward
  std::size_t first = 0;    // sample after which the first gap, step backward or other rate comes
  double other_step = 0.0;  // s, of kMixedRates
};

// At least two finite times, s.
[[nodiscard]] TimeAxis examine_times(const Eigen::Ref<const Eigen::VectorXd>& times);

// Adds what is wrong with the times of `source` if samples are said to be `sample_time` apart.
// (None: irregular, where the times themselves are used and only their order is required.) The
// `offset` is the number of the first sample in its file. Nothing is resampled.
//   Errors: no order, gaps, two rates, irregular times or jitter above 10 % where samples are said
//   to be even, and a step that is not the sample time (0.1 %; 1 % below 1000 samples).
//   Warnings: jitter up to 10 %; gaps in irregular recordings.
void check_times(const std::string& source, const Eigen::Ref<const Eigen::VectorXd>& times,
                 std::optional<double> sample_time, std::size_t offset,
                 std::vector<Finding>& findings);

}  // namespace graybox
