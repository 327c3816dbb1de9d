#include "diagnosis/predictor/drive_signals.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "diagnosis/predictor/drive_start.hpp"

namespace graybox {
namespace {

using Eigen::Index;

bool is_at_actuator(const Element& part) { return part.location.kind == LocationKind::kActuator; }

bool has_memory(const Element& part) {
  if (!is_at_actuator(part)) return false;
  return part.use == LawUse::kDelay || part.law_name == "lag" || part.law_name == "rate_limit" ||
         (part.law && part.law->state_count() > 0);
}

// exp(-r t) on 0 <= t <= 1 as a parabola at 0, 1/2 and 1: from its moments, as in jump_nodes of
// node_inputs.cpp; for small r the values themselves, which differ by r^3/100.
std::array<double, 3> decay_nodes(double r) {
  if (r < 0.05) return {1.0, std::exp(-0.5 * r), std::exp(-r)};
  const double end = std::exp(-r);
  const double m0 = (1.0 - end) / r, m1 = (m0 - end) / r, m2 = (2.0 * m1 - end) / r;
  const double c0 = m0, c1 = 3.0 * (2.0 * m1 - m0), c2 = 5.0 * (6.0 * m2 - 6.0 * m1 + m0);
  return {c0 - c1 + c2, c0 - 0.5 * c2, c0 + c1 + c2};
}

void apply_lag(double time_constant, double step, Index channel, double before, NodeInputs& drive) {
  const double r = step / std::max(time_constant, 1e-12 * step);
  const std::array<double, 3> decay = decay_nodes(r);
  const double end = std::exp(-r), behind = 1.0 / r;  // T in steps
  const Index steps = drive.nodes.cols() / 3, m = drive.steps_per_sample;
  double x = before;
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

// Walks the record by half steps: `advance` takes the states from one signal to the next, and
// `passed` says what they make of a signal.
template <typename Passed, typename Advance>
void pass_with_states(Index channel, const Passed& passed, const Advance& advance,
                      NodeInputs& drive) {
  const Index steps = drive.nodes.cols() / 3, m = drive.steps_per_sample;
  for (Index s = 0; s < steps; ++s) {
    const double a = drive.nodes(channel, 3 * s), b = drive.nodes(channel, 3 * s + 2),
                 middle = 0.5 * (a + b);
    if (s % m == 0) drive.samples(channel, s / m) = passed(a);
    drive.nodes(channel, 3 * s) = passed(a);
    advance(a, middle);
    drive.nodes(channel, 3 * s + 1) = passed(middle);
    advance(middle, b);
    drive.nodes(channel, 3 * s + 2) = passed(b);
  }
  const Index last = drive.samples.cols() - 1;
  drive.samples(channel, last) = passed(drive.samples(channel, last));
}

void apply_rate_limit(const RateLimitStep& law, Index channel, double before, NodeInputs& drive) {
  double x = before;
  pass_with_states(
      channel, [&](double) { return x; },
      [&](double begin, double now) { x = law.from(x, begin, now); }, drive);
}

// Other laws with states: midpoint steps, sixteen a step.
void apply_states(const Law& law, double step, Index channel, double before, NodeInputs& drive) {
  constexpr int kParts = 8;
  const double part = 0.5 * step / kParts;
  const std::size_t count = law.state_count();
  std::vector<double> x(count), middle(count), rate(count);
  law.rest(before, x);
  const auto advance = [&](double begin, double now) {
    const double change = (now - begin) / kParts;
    for (int k = 0; k < kParts; ++k) {
      const double from = begin + change * k;
      law.state_rate(from, 0.0, x, rate);
      for (std::size_t i = 0; i < count; ++i) middle[i] = x[i] + 0.5 * part * rate[i];
      law.state_rate(from + 0.5 * change, 0.0, middle, rate);
      for (std::size_t i = 0; i < count; ++i) x[i] += part * rate[i];
    }
  };
  pass_with_states(
      channel, [&](double signal) { return signal + law.force(signal, 0.0, x); }, advance, drive);
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

RateLimitStep::RateLimitStep(double limit, double time_constant, double seconds)
    : most_(limit * seconds / kParts),
      follows_(-std::expm1(-seconds / kParts / std::max(time_constant, 1e-12 * seconds))) {}

double RateLimitStep::from(double x, double before, double now) const {
  for (int k = 0; k < kParts; ++k) {
    const double signal = before + (now - before) * (k + 0.5) / kParts;
    x += std::clamp((signal - x) * follows_, -most_, most_);
  }
  return x;
}

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

// A law with a memory passes what was recorded before as well.
Eigen::VectorXd DriveSignals::begin_before(const NodeInputs& plain,
                                           const OutputErrorRecording& recording,
                                           const LumpedModel& model, double sample_time) {
  const bool goes_on = recording.past_inputs.rows() > 0;
  const Eigen::VectorXd before =
      goes_on ? Eigen::VectorXd(recording.past_inputs.row(0)) : drives_before(model, recording);
  const Eigen::VectorXd delays = delays_of(model, recording.inputs.cols(), sample_time);
  const bool is_plain = !goes_on && delays.isZero(0.0);
  changed_ = is_plain ? plain
                      : node_inputs(recording.inputs_with_past(), hold_, plain.steps_per_sample,
                                    delays, false, before);
  return before;
}

void DriveSignals::apply(const Element& part, double step, const Eigen::VectorXd& before) {
  const Index channel = part.location.channel;
  if (part.law_name == "lag") {
    apply_lag(part.parameters[0], step, channel, before(channel), changed_);
  } else if (part.law_name == "rate_limit") {
    apply_rate_limit({part.parameters[0], part.parameters[1], 0.5 * step}, channel, before(channel),
                     changed_);
  } else if (part.law->state_count() > 0) {
    apply_states(*part.law, step, channel, before(channel), changed_);
  } else {
    apply_static(*part.law, channel, part.location.driver, changed_);
  }
}

const NodeInputs& DriveSignals::of(std::size_t recording, const LumpedModel& model,
                                   double sample_time) {
  const NodeInputs& plain = (*recorded_)[recording];
  if (std::ranges::none_of(model.parts, is_at_actuator)) return plain;
  const OutputErrorRecording& run = recordings_[recording];
  const bool remembers = std::ranges::any_of(model.parts, has_memory);
  Eigen::VectorXd before;
  if (remembers) {
    before = begin_before(plain, run, model, sample_time);
  } else {
    changed_ = plain;
  }
  const double step = sample_time / plain.steps_per_sample;
  for (const Element& part : model.parts) {
    if (is_at_actuator(part) && part.law) apply(part, step, before);
  }
  if (remembers) changed_.drop_samples(run.past_inputs.rows());
  return changed_;
}

}  // namespace graybox
