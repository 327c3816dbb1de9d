// A sensor that holds its value for a while and then goes on.
//
// Rule: the longest run of equal values that is longer than `shortest` and 20 samples, lies inside
// the recording, is not at the largest or smallest value (that is a limit), and either
//   ends in a jump above 5 times the step that 99 % of all steps keep below, or
//   begins in full motion: each of the five steps before it is above half the 90 % quantile of
//   steps, or
//   stands in noise, and not at zero: elsewhere less than 2 % of all steps are zero, and 30 % turn
//   round. A sensor of an axis that stands goes on trembling then.
// By itself this is weak: a motion that starts and stops abruptly does the same. Another channel
// that goes on makes it likely, all others standing still too makes it a recording that was frozen.
// No answer for signals of at most 16 levels and below 100 samples. Cost: O(n).
#pragma once

#include <Eigen/Core>
#include <optional>

namespace graybox {

struct StuckRun {
  Eigen::Index first;
  Eigen::Index last;  // included
  double strength;    // the jump, the motion or the length over its threshold
  bool ends_in_jump;
};

// `shortest` in samples; the command takes what lasts 50 ms.
[[nodiscard]] std::optional<StuckRun> find_stuck_run(
    const Eigen::Ref<const Eigen::VectorXd>& values, Eigen::Index shortest);

}  // namespace graybox
