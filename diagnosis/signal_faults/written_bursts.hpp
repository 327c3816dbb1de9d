// Rows that a logger wrote again: bursts of rows with one time stamp, or nearly, that hold one
// measurement, and then a pause.
//
// A burst is told from its steps and from the values. Either steps are of two sizes, a fifth of the
// pauses and below against half of them and above, with bursts that end within half a pause; or
// steps are zero. And of all that a value changes by, at most a tenth falls within bursts: what was
// measured anew in each row is no repetition. Cost: O(n log n).
//
// A single row is told otherwise. It holds the values of the row before or behind it. And another
// row stands beside it, where no sample is due.
//
//   find_bursts(times, {angle})            // {0.06}: rows within 0.06 s of one are that one again
//   repeated_rows(times, {angle, torque})  // {76}: stamped 0.7498 beside 0.75, with rows of 0.01 s
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
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

// Single rows that are the sample of the row before or behind them, logged twice. All values are
// equal bit for bit. The stamp is less than a tenth of the median step from that of another row.
// None where more than one step in fifty is so short: find_bursts() has such logs.
[[nodiscard]] std::vector<Eigen::Index> repeated_rows(const Eigen::VectorXd& times,
                                                      const std::vector<Eigen::VectorXd>& values);

// "3 rows hold the values of a row beside them ...": of the file, whose rows count from 1.
[[nodiscard]] std::string words_of_repeated(const std::vector<Eigen::Index>& rows);

}  // namespace graybox
