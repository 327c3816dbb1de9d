#include "diagnosis/signal_faults/wrong_stamp.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kFarOutside = 20.0;  // median steps
constexpr double kMoreSteps = 3.0;    // between the neighbours, beside those of the rows
constexpr Index kMostStampsAtOnce = 8;

// Rows `first` to `last` lie far outside their neighbours, which go on as if nothing had been.
bool are_wrong(const VectorXd& times, Index first, Index last, double step) {
  const double before = times(first - 1), behind = times(last + 1);
  const auto rows = static_cast<double>(last - first + 1);
  if (!(behind > before) || behind - before > (rows + 1.0 + kMoreSteps) * step) return false;
  for (Index k = first; k <= last; ++k) {
    const double off = std::max(before - times(k), times(k) - behind);
    if (!(off > kFarOutside * step)) return false;
  }
  return true;
}

// What all rows are wrong by, in whole units; 0 where that is none.
double whole_units_off(const VectorXd& times, Index first, Index last, double step) {
  const double before = times(first - 1), behind = times(last + 1);
  const double off = 0.5 * (before + behind) - times.segment(first, last - first + 1).mean();
  for (const double unit : {3600.0, 1000.0, 60.0, 1.0}) {
    const double whole = unit * std::round(off / unit);
    if (whole == 0.0 || std::abs(off - whole) > 2.0 * step || unit < 4.0 * step) continue;
    double last_time = before;
    bool rises = true;
    for (Index k = first; k <= last; ++k) {
      rises = rises && times(k) + whole > last_time;
      last_time = times(k) + whole;
    }
    if (rises && behind > last_time) return whole;
  }
  return 0.0;
}

void mend_rows(Index first, Index last, double step, VectorXd& times,
               std::vector<WrongStamp>& mended) {
  const double whole = whole_units_off(times, first, last, step);
  const double before = times(first - 1), behind = times(last + 1);
  for (Index k = first; k <= last; ++k) {
    const double share = static_cast<double>(k - first + 1) / static_cast<double>(last - first + 2);
    const double now = whole != 0.0 ? times(k) + whole : before + share * (behind - before);
    mended.push_back({k, times(k), now});
    times(k) = now;
  }
}

}  // namespace

std::vector<WrongStamp> mend_stamps(VectorXd& times) {
  constexpr Index kFewest = 10, kShare = 50;
  std::vector<WrongStamp> mended;
  const Index n = times.size();
  if (n < kFewest || !times.allFinite()) return mended;
  const VectorXd steps = steps_of(times);
  if ((steps.array() > 0.0).all()) return mended;
  const double step = quantile(steps, 0.5);
  if (!(step > 0.0)) return mended;
  VectorXd now = times;
  for (Index k = 1; k + 1 < n; ++k) {
    for (Index last = k; last < std::min(k + kMostStampsAtOnce, n - 1); ++last) {
      if (!are_wrong(now, k, last, step)) continue;
      mend_rows(k, last, step, now, mended);
      break;
    }
  }
  if (kShare * static_cast<Index>(mended.size()) > n + kShare) return {};
  times = now;
  return mended;
}

std::string words_of_stamps(const std::vector<WrongStamp>& stamps) {
  if (stamps.empty()) return "";
  const WrongStamp& first = stamps.front();
  const double off = first.mended - first.recorded;
  return fmt::format(
      "{:.10g} is {:.4g} too {}: read as {:.10g}{}", first.recorded, std::abs(off),
      off > 0.0 ? "early" : "late", first.mended,
      stamps.size() == 1 ? "" : fmt::format(", and {} more alike", stamps.size() - 1));
}

}  // namespace graybox
