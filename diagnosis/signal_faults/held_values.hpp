// Signals that change only every n-th sample: measured, or sent, at a slower rate than they were
// logged. Differences of neighbours are then zero and jumps.
//
// Rule: of the intervals between changes, in samples, two in five or more are n, the commonest and
// at least 2, and nine in ten are whole multiples of n. A tenth of the changes or more are above
// 1.5 times the smallest one (a slow ramp of a coarse sensor has equal ones). At least twelve
// changes, and more than 16 levels. Rates: docs/how_to/faulty_data.md. Cost: O(n log n).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>

namespace graybox {

struct HeldValues {
  Eigen::Index samples;   // n
  Eigen::Index first;     // sample of the first change
  double step = 0.0;      // of which all changes are whole multiples (within 2 %); 0: none
  double strength = 0.0;  // changes over the fewest
};

[[nodiscard]] std::optional<HeldValues> find_held_values(
    const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace graybox
