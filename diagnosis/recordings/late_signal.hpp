// How much later, larger or reversed one recorded signal is than another of the same motion:
//
//   y(t) = gain x(t - delay), lagged by a first-order lag of time constant T,  + offset
//
// with delay alone (of either sign), T alone and both (neither negative), by least squares: gain
// and offset are linear, delay and T by Gauss and Newton from the best whole-sample shift. Both
// signals go through one zero-phase low-pass at a tenth of the sample rate before, which leaves the
// relation as it is and takes the noise of differences. At first order in frequency delay and lag
// are the same: what is sure is their sum, `late`; which of them it is, the misfits tell.
//
// A shift by one period more fits a nearly periodic motion nearly as well. So the first shift is
// sought within half a period, and the smallest of those that are nearly the best wins.
//
// Errors: standard errors by the sandwich over 20 blocks, so that errors may be correlated within
// them. Delays by cubic interpolation, lags exactly for signals that are linear between samples.
// Cost: O(samples), some 200 passes; at most 20 000 samples of the middle are used.
#pragma once

#include <Eigen/Core>

namespace graybox {

struct LateFit {
  double gain = 0.0, gain_error = 0.0;
  double late = 0.0, late_error = 0.0;  // s, delay + lag
  double delay = 0.0, lag = 0.0;        // s
  double misfit = 0.0;                  // rms of what is left over the deviation of y
};

struct LateComparison {
  LateFit in_time;  // delay = lag = 0
  LateFit delayed, lagged, both;

  // The plainest whose misfit is within 10 % of the least.
  [[nodiscard]] const LateFit& best() const;
  // Whether a delay and a lag can be told apart: their misfits differ by more than 20 %.
  [[nodiscard]] bool tells_delay_from_lag() const;
};

// Signals of equal length, at least 200 samples, both moving.
[[nodiscard]] LateComparison compare_late(const Eigen::Ref<const Eigen::VectorXd>& x,
                                          const Eigen::Ref<const Eigen::VectorXd>& y,
                                          double sample_time);

}  // namespace graybox
