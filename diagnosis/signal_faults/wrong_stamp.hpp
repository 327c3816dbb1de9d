// Single time stamps that are wrong while the clock goes on: 24.997, 24.002, 25.009. A second that
// was not carried when two registers were read is the usual cause.
//
// Up to eight rows in a row are wrong where each lies far outside the times before and behind them
// (20 median steps), and these two are no further apart than that many rows and three more. Where
// whole units (1, 60, 1000 or 3600 of what is recorded) bring them back in order within two steps,
// these are added; else they are spread evenly between their neighbours. A clock that begins anew
// is no such thing, nor are rows that came in another order. Cost: O(n).
//
//   Eigen::VectorXd times{{24.987, 24.997, 24.002, 25.009, ...}};
//   for (const WrongStamp& each : mend_stamps(times)) tell(each);   // times(2) is 25.002
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace graybox {

struct WrongStamp {
  Eigen::Index sample = 0;
  double recorded = 0.0, mended = 0.0;
};

// Mends them in their place. Times with values that are not finite, and those of which more than
// one in fifty would be wrong, stay as they are.
[[nodiscard]] std::vector<WrongStamp> mend_stamps(Eigen::VectorXd& times);

// "24.002 is 1 too early: read as 25.002", and how many others.
[[nodiscard]] std::string words_of_stamps(const std::vector<WrongStamp>& stamps);

}  // namespace graybox
