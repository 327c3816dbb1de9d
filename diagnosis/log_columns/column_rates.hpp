// Positions beside their velocities: units from data. With the rate of a position over time in the
// recorded units, dq/dt = factor * velocity, and the factor tells degrees from radians and rpm:
//
//   rad, rad/s 1     deg, rad/s 57.3     deg, rpm 6     rad, rpm 0.105     turn, rad/s 0.159
//
// A velocity may be filtered: it is compared with lag and delay (late_signal.hpp).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/log_columns/log_recordings.hpp"

namespace graybox {

struct RateFit {
  double factor = 0.0;  // d position / dt over velocity, recorded units
  double late = 0.0;    // s, of the velocity
  double misfit = 0.0;  // rms of what is left over the velocity's deviation
};

// `step`: between samples. None where one is not the rate of the other (more than half is left),
// or below 50 samples. Below 200 the velocity is late by whole samples.
[[nodiscard]] std::optional<RateFit> fit_rate(const Eigen::VectorXd& position,
                                              const Eigen::VectorXd& velocity, double step);

struct MotionUnits {
  std::string position, velocity;
  bool is_found = false;     // the data agree with these units within an eighth
  bool contradicts = false;  // no units that the titles allow agree
  std::string why;
};

// Units of a pair. Those that are stated (not empty) are held; SI is preferred among equals.
[[nodiscard]] MotionUnits units_by_rate(double factor, const std::string& position,
                                        const std::string& velocity, MotionKind motion);

// The unit of a time in which the recording's first position and velocity of one joint belong
// together; empty if none or several do. `step`: between samples, in that unit.
[[nodiscard]] std::string time_unit_by_rates(const LogRecording& recording, double step);

// Where no title says position or velocity: the one pair of unnamed columns of which one is the
// rate of the other is taken for that. `step`: between samples, or 1.
void name_by_rates(std::vector<LogRecording>& recordings, double step);

// The position without wraps, if it is an angle that is kept within a turn; `turn` in its unit or
// 0. The second is whether there were any.
[[nodiscard]] std::pair<Eigen::VectorXd, bool> without_wraps(const Eigen::VectorXd& position,
                                                             double turn);

}  // namespace graybox
