// Rows that a logger wrote again: bursts of rows with one time stamp, or nearly, that hold one
// measurement, and then a pause.
//
// A burst is told from its steps and from the values. Either steps are of two sizes, a fifth of the
// pauses and below against half of them and above, with bursts that end within half a pause; or
// steps are zero. And of all that a value changes by, at most a tenth falls within bursts: what was
// measured anew in each row is no repetition. Cost: O(n log n).
//
//   find_bursts(times, {angle})            // {0.06}: rows within 0.06 s of one are that one again
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace graybox {

struct WrittenBursts {
  double within = 0.0;  // in the times' unit; 0: equal times alone
};

// `times` may hold NaN, and may fall; `values` are what was measured, of the same length each.
[[nodiscard]] std::optional<WrittenBursts> find_bursts(const Eigen::VectorXd& times,
                                                       const std::vector<Eigen::VectorXd>& values);

// Rows that are samples of their own: those with a time that are no repetition. `within` below 0:
// no row is.
[[nodiscard]] std::vector<Eigen::Index> rows_of_samples(
    const Eigen::Ref<const Eigen::VectorXd>& times, double within);

}  // namespace graybox
