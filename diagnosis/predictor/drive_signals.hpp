// What the actuators give: recorded inputs, passed through the actuator laws of a model, at the
// beginning, the middle and the end of each step of an integrator (node_inputs.hpp).
//
// Actuator laws depend on the recorded input alone, never on the motion, so one pass over the
// record does all of them. Delays come first (they commute with the others). A lag x' = (s - x)/T
// is exact for an input that is straight within a step:
//
//   x(t) = a + b (t - T) + (x_0 - a + b T) exp(-t/T),   s = a + b t,
//
// and the exponential enters by the parabola that has its integrals against 1, t and t^2. So a lag
// far shorter than a step is right, too, and T -> 0 is continuous.
//
// Laws with states, and delays, begin in the part of the file before this one. Where there is none
// they begin from what drive_start.hpp says of the time before the record. A rate limit, and any
// other law with states, goes in sixteen parts of a step.
//
//   DriveSignals signals(recordings, InputHold::kZero, 2);
//   const NodeInputs& drive = signals.of(0, model);      // valid until the next call
//
// One object serves one thread. Cost: one pass over the record, none where no actuator has a law.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "diagnosis/output_error/node_inputs.hpp"
#include "diagnosis/output_error/output_error_problem.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {

// The recorded inputs without any law; shared by all threads.
using RecordedNodes = std::vector<NodeInputs>;
[[nodiscard]] RecordedNodes recorded_nodes(std::span<const OutputErrorRecording> recordings,
                                           InputHold hold, int steps_per_sample);

// A rate limit x' = clip((s - x)/T, -limit, limit) over so many seconds, in eight parts: in each
// the exact answer to the middle of s, and no more than the limit.
class RateLimitStep {
 public:
  RateLimitStep(double limit, double time_constant, double seconds);
  // x at the end, where s goes straight from `before` to `now`.
  [[nodiscard]] double from(double x, double before, double now) const;

 private:
  static constexpr int kParts = 8;
  double most_, follows_;  // a part
};

class DriveSignals {
 public:
  // Both are kept by reference.
  DriveSignals(std::span<const OutputErrorRecording> recordings, InputHold hold,
               const RecordedNodes& recorded);
  // `sample_time` in s.
  [[nodiscard]] const NodeInputs& of(std::size_t recording, const LumpedModel& model,
                                     double sample_time);

 private:
  [[nodiscard]] Eigen::VectorXd begin_before(const NodeInputs& plain,
                                             const OutputErrorRecording& recording,
                                             const LumpedModel& model, double sample_time);
  void apply(const Element& part, double step, const Eigen::VectorXd& before);

  std::span<const OutputErrorRecording> recordings_;
  InputHold hold_;
  const RecordedNodes* recorded_;
  NodeInputs changed_;
};

}  // namespace graybox
