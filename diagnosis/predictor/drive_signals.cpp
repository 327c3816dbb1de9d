#include "diagnosis/predictor/drive_signals.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;

bool is_at_actuator(const Element& part) { return part.location.kind == LocationKind::kActuator; }

// exp(-r t) on 0 <= t <= 1 as a parabola at 0, 1/2 and 1: from its moments, as in jump_nodes of
// node_inputs.cpp; for small r the values themselves, which differ by r^3/100.
std::array<double, 3> decay_nodes(double r) {
  if (r < 0.05) return {1.0, std::exp(-0.5 * r), std::exp(-r)};
  const double end = std::exp(-r);
  const double m0 = (1.0 - end) / r, m1 = (m0 - end) / r, m2 = (2.0 * m1 - end) / r;
  const double c0 = m0, c1 = 3.0 * (2.0 * m1 - m0), c2 = 5.0 * (6.0 * m2 - 6.0 * m1 + m0);
  return {c0 - c1 + c2, c0 - 0.5 * c2, c0 + c1 + c2};
}

void apply_lag(double time_constant, double step, Index channel, NodeInputs& drive) {
  const double r = step / std::max(time_constant, 1e-12 * step);
  const std::array<double, 3> decay = decay_nodes(r);
  const double end = std::exp(-r), behind = 1.0 / r;  // T in steps
  const Index steps = drive.nodes.cols() / 3, m = drive.steps_per_sample;
  double x = drive.samples(channel, 0);
  for (Index s = 0; s < steps; ++s) {
    const double a = drive.nodes(channel, 3 * s);
    const double b = drive.nodes(channel, 3 * s + 2) - a;
    const double excess = x - a + b * behind;
    if (s % m == 0) drive.samples(channel, s / m) = x;
    for (Index node = 0; node < 3; ++node) {
      const double t = 0.5 * static_cast<double>(node);
      drive.nodes(channel, 3 * s + node) =
          a + b * (t - behind) + excess * decay[static_cast<std::size_t>(node)];
    }
    x = a + b * (1.0 - behind) + excess * end;
  }
  drive.samples(channel, drive.samples.cols() - 1) = x;
}

void apply_static(const Law& law, Index channel, Index driver, NodeInputs& drive) {
  const auto pass = [&](Eigen::MatrixXd& values) {
    for (Index k = 0; k < values.cols(); ++k) {
      const double by = driver >= 0 ? values(driver, k) : values(channel, k);
      values(channel, k) += law.force(by, 0.0, {});
    }
  };
  pass(drive.nodes);
  pass(drive.samples);
}

Eigen::VectorXd delays_of(const LumpedModel& model, Index channels, double sample_time) {
  Eigen::VectorXd delays = Eigen::VectorXd::Zero(channels);
  for (const Element& part : model.parts) {
    if (is_at_actuator(part) && part.use == LawUse::kDelay) {
      delays(part.location.channel) += part.parameters[0] / sample_time;
    }
  }
  return delays;
}

}  // namespace

RecordedNodes recorded_nodes(std::span<const OutputErrorRecording> recordings, InputHold hold,
                             int steps_per_sample) {
  RecordedNodes nodes;
  for (const OutputErrorRecording& recording : recordings) {
    nodes.push_back(node_inputs(recording.inputs, hold, steps_per_sample));
  }
  return nodes;
}

DriveSignals::DriveSignals(std::span<const OutputErrorRecording> recordings, InputHold hold,
                           const RecordedNodes& recorded)
    : recordings_(recordings), hold_(hold), recorded_(&recorded) {}

const NodeInputs& DriveSignals::of(std::size_t recording, const LumpedModel& model,
                                   double sample_time) {
  const NodeInputs& plain = (*recorded_)[recording];
  if (std::ranges::none_of(model.parts, is_at_actuator)) return plain;
  const Eigen::VectorXd delays =
      delays_of(model, recordings_[recording].inputs.cols(), sample_time);
  changed_ = delays.isZero(0.0) ? plain
                                : node_inputs(recordings_[recording].inputs, hold_,
                                              plain.steps_per_sample, delays);
  const double step = sample_time / plain.steps_per_sample;
  for (const Element& part : model.parts) {
    if (!is_at_actuator(part) || !part.law) continue;
    const Index channel = part.location.channel;
    if (part.law_name == "lag") {
      apply_lag(part.parameters[0], step, channel, changed_);
    } else {
      apply_static(*part.law, channel, part.location.driver, changed_);
    }
  }
  return changed_;
}

}  // namespace graybox
