// What a column's samples say of it as a drive, before any model: a supply's voltage hardly moves
// and keeps its sign, a duty cycle without direction is never negative while the axis goes both
// ways.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/log_columns/sign_bit.hpp"

namespace graybox {

struct DriveManner {
  double variation = 0.0;     // deviation over the size of the mean, of all recordings
  bool has_one_sign = false;  // in all recordings, while the axis moves both ways
  // But for few and small samples, while the axis goes both ways in all recordings together.
  bool has_nearly_one_sign = false;
  bool hardly_moves = false;  // one sign, a variation below a tenth, and on at both ends
  bool lost_sign = false;     // its size follows the motion of either way (lost_sign.hpp)
  // Its sign is a bit of its own: then nothing is said of its one sign.
  std::optional<SignBit> sign_bit = {};
  double follows = 0.0;  // largest correlation with position, speed or acceleration
};

// Over all recordings, beside the measured positions and velocities that move.
[[nodiscard]] DriveManner manner_of_drive(const LogColumn& drive,
                                          const std::vector<LogRecording>& recordings);

// Whether two columns tell other things: a correlation below 0.9, of either sign.
[[nodiscard]] bool disagree(const LogColumn& a, const LogColumn& b);

// What a sum of a constant and of these signals leaves of the drive, of its deviation; none: too
// few samples, or a constant drive.
[[nodiscard]] std::optional<double> left_of_feedback(const Eigen::VectorXd& drive,
                                                     const std::vector<Eigen::VectorXd>& measured);

// The share that a controller of the position leaves of the drive: by the position, its change over
// one row, and a step at the drive's sign that a dead band asks for. None where a plain motor may
// do it.
// The drive of a controller has more than 16 levels, and acts against position and rate. A step
// goes away from zero. The position takes three quarters of what the others leave, and these half
// of what it leaves. The drive's steps from row to row follow, too, by half: no machine hears the
// noise of its encoder. And the position is no swing at one frequency, of which any other is a sum.
[[nodiscard]] std::optional<double> left_of_position_feedback(const Eigen::VectorXd& drive,
                                                              const Eigen::VectorXd& position);

// "moves by 2.3 % of its mean and never changes its sign", for a question.
[[nodiscard]] std::string doubt_words(const LogColumn& drive, const DriveManner& manner);

}  // namespace graybox
