#include "diagnosis/predictor/drive_start.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kSame = 0.02;                      // of a drive's first value
constexpr double kLarge = 0.05;                     // of its largest value
constexpr Index kFewest = 8;                        // samples
constexpr double kRests = 0.05, kGoes = 1.0 / 3.0;  // of the rms speed
constexpr double kLate = 0.42;                      // of the speed at which it goes

constexpr Index kFewestSteady = 5;  // samples

bool has_spring(const LumpedModel& model) {
  return std::ranges::any_of(model.parts, [](const Element& part) {
    return part.law_name == "stiffness" || part.law_name == "cubic_spring" ||
           part.law_name == "gravity";
  });
}

// The speed that the first output of position or velocity shows.
std::optional<VectorXd> measured_speed(const LumpedModel& model,
                                       const OutputErrorRecording& recording) {
  for (std::size_t j = 0; j < model.outputs.size(); ++j) {
    const auto values = recording.outputs.col(static_cast<Index>(j));
    if (model.outputs[j].quantity == LumpedOutput::Quantity::kVelocity) return VectorXd(values);
    if (model.outputs[j].quantity == LumpedOutput::Quantity::kPosition) {
      return VectorXd(values.tail(values.size() - 1) - values.head(values.size() - 1));
    }
  }
  return {};
}

// How many samples a drive stays where it begins.
Index samples_at_start(const VectorXd& drive) {
  Index count = 1;
  while (count < drive.size() && std::abs(drive(count) - drive(0)) <= kSame * std::abs(drive(0))) {
    ++count;
  }
  return count;
}

double rms_of(const VectorXd& speed) {
  return std::sqrt(speed.squaredNorm() / static_cast<double>(speed.size()));
}

// The first of so many samples at which it goes; none: it does not.
std::optional<Index> goes_at(const VectorXd& speed, Index samples) {
  const double goes = kGoes * rms_of(speed);
  const Index count = std::min(samples, speed.size());
  for (Index k = 0; k < count; ++k) {
    if (std::abs(speed(k)) >= goes) return k;
  }
  return {};
}

// Whether it goes from rest while the drive stays, and the later, the faster: half-way to that
// speed in time it has less than an even acceleration would give.
bool gets_going_late(const VectorXd& speed, Index samples) {
  if (!(std::abs(speed.head(2).mean()) <= kRests * rms_of(speed))) return false;
  const std::optional<Index> goes = goes_at(speed, samples);
  if (!goes || *goes < kFewest) return false;
  return std::abs(speed(*goes / 2)) <= kLate * std::abs(speed(*goes));
}

}  // namespace

VectorXd drives_before(const LumpedModel& model, const OutputErrorRecording& recording) {
  VectorXd before = recording.inputs.row(0).transpose();
  const bool is_measured = recording.outputs.rows() == recording.inputs.rows();
  if (has_spring(model) || !is_measured) return before;
  const std::optional<VectorXd> speed = measured_speed(model, recording);
  if (!speed) return before;
  const bool rests = samples_at_rest(model, recording) > 0;
  for (std::size_t j = 0; j < model.inputs.size(); ++j) {
    if (model.inputs[j].kind != LumpedInput::Kind::kForce) continue;
    const VectorXd drive = recording.inputs.col(static_cast<Index>(j));
    const bool is_large = std::abs(drive(0)) > kLarge * drive.cwiseAbs().maxCoeff();
    const Index stays = samples_at_start(drive);
    const bool begins = rests ? goes_at(*speed, stays).has_value() : gets_going_late(*speed, stays);
    if (is_large && begins) before(static_cast<Index>(j)) = 0.0;
  }
  return before;
}

Index samples_at_rest(const LumpedModel& model, const OutputErrorRecording& recording) {
  const bool is_one_mass = model.masses.size() == 1 && !model.imposed.front();
  if (!is_one_mass || recording.past_inputs.rows() > 0 || recording.outputs.rows() < 3) return 0;
  const std::optional<VectorXd> speed = measured_speed(model, recording);
  if (!speed) return 0;
  const double still = kRests * rms_of(*speed);
  const bool is_position = model.outputs.front().quantity == LumpedOutput::Quantity::kPosition;
  const bool is_zeroed = recording.outputs(0, 0) == 0.0 && std::abs((*speed)(0)) <= still;
  // A coarse position reads the same twice in slow motion, too.
  const bool stands = is_position && speed->size() > 3 && speed->head(3).isZero(0.0);
  if (!is_zeroed && !stands) return 0;
  Index count = 1;
  while (count < speed->size() && std::abs((*speed)(count)) <= still) ++count;
  return count;
}

Index samples_at_one_speed(const LumpedModel& model, const OutputErrorRecording& recording) {
  constexpr double kKeeps = 0.05;  // of all that the speed covers
  const bool is_one_mass = model.masses.size() == 1 && !model.imposed.front();
  const bool is_velocity = model.outputs.front().quantity == LumpedOutput::Quantity::kVelocity;
  if (!is_one_mass || !is_velocity || recording.past_inputs.rows() > 0) return 0;
  Index count = recording.inputs.rows();
  for (Index j = 0; j < recording.inputs.cols(); ++j) {
    count = std::min(count, samples_at_start(recording.inputs.col(j)));
  }
  if (count < kFewestSteady || count > recording.outputs.rows() / 2) return 0;
  const VectorXd speed = recording.outputs.col(0);
  const auto span = [](const auto& values) { return values.maxCoeff() - values.minCoeff(); };
  return span(speed.head(count)) <= kKeeps * span(speed) ? count : 0;
}

}  // namespace graybox
