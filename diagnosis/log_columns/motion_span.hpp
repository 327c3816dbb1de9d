// What part of a log moves, and how fast: where to cut it for the fit and the check, and where to
// filter before differentiating.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

// Samples from the first to the last that move, both included, with `margin` samples beside.
struct MotionSpan {
  Eigen::Index first = 0, last = 0;
};

// A position moves where its change over a fiftieth of a second or two samples is above 1 % of the
// largest such change; a velocity where it is above 1 % of its largest. The largest changes of a
// few samples, as spikes make them, do not count for that: of four such stretches and two samples
// in a thousand. Each column of `motions` is one signal.
[[nodiscard]] MotionSpan motion_span(const std::vector<Eigen::VectorXd>& motions,
                                     bool are_velocities, double sample_time);

// The frequency below which 99 % of the power of the velocity lie, of the median signal, Hz.
[[nodiscard]] double motion_frequency(const std::vector<Eigen::VectorXd>& motions,
                                      bool are_velocities, double sample_time);

// The frequency at which a free motion swings, Hz. It is that of the largest line of the velocity's
// power, with half of all power beside it. 0 where there is none, and below two periods.
[[nodiscard]] double swing_frequency(const Eigen::VectorXd& motion, bool is_velocity,
                                     double sample_time);

// 15 times motion_frequency(), in two digits: from 2 Hz to a fifth of the sample rate.
[[nodiscard]] double filter_frequency(const std::vector<Eigen::VectorXd>& motions,
                                      bool are_velocities, double sample_time);

}  // namespace graybox
