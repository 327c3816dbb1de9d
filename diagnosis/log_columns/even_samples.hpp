// A log's columns at even times, for what assumes them: rates and starting values. Where times are
// uneven the longest stretch without a gap is taken, by the cubic through the four nearest samples.
// Where a measured signal holds its values, one of so many samples is taken.
//
//   const EvenSamples even(log, time);
//   start_two_masses(even.of(force), even.of(motor), even.of(load), false, even.step());
#pragma once

#include <Eigen/Core>

#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/log_columns/log_time.hpp"

namespace graybox {

class EvenSamples {
 public:
  EvenSamples() = default;  // samples as they are
  EvenSamples(const LogRecording& recording, const LogTime& time);

  [[nodiscard]] double step() const { return step_; }  // s; 0 where it is not known
  [[nodiscard]] Eigen::VectorXd of(const Eigen::VectorXd& values) const;

 private:
  Eigen::VectorXd times_, at_;  // s; empty: even as recorded
  Eigen::Index first_ = 0, count_ = 0;
  Eigen::Index every_ = 1, from_ = 0;
  double step_ = 0.0;
};

// Values that are no numbers replaced by those before them.
[[nodiscard]] Eigen::VectorXd without_gaps(Eigen::VectorXd values);

}  // namespace graybox
