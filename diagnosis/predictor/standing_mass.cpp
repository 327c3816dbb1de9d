#include "diagnosis/predictor/standing_mass.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using Quantity = LumpedOutput::Quantity;

constexpr double kStill = 0.002;       // of the rms speed
constexpr double kShortestStay = 0.3;  // s
constexpr double kSteps = 1.01;        // of the encoder

bool is_damper(const Element& part) {
  constexpr std::array<std::string_view, 3> kDampers{"viscous", "asymmetric_viscous",
                                                     "quadratic_drag"};
  return std::ranges::count(kDampers, part.law_name) > 0;
}

bool may_stand_by_friction_alone(const LumpedModel& model) {
  return model.mass_names.size() == 1 && !model.has_imposed_motion() && model.inputs.size() == 1 &&
         model.inputs.front().kind == LumpedInput::Kind::kForce &&
         std::ranges::all_of(model.parts, is_damper);
}

std::optional<std::size_t> output_of(const LumpedModel& model, Quantity quantity) {
  const auto at = std::ranges::find(model.outputs, quantity, &LumpedOutput::quantity);
  if (at == model.outputs.end()) return {};
  return static_cast<std::size_t>(at - model.outputs.begin());
}

// The mass's position along a recording; of a velocity its integral.
VectorXd position_along(const OutputErrorRecording& recording, Index output, Quantity quantity) {
  VectorXd position = recording.outputs.col(output);
  if (quantity == Quantity::kPosition) return position;
  double sum = 0.0;
  for (Index k = 0; k < position.size(); ++k) {
    const double step = k > 0 ? recording.time(k) - recording.time(k - 1) : 0.0;
    sum += step * position(k);
    position(k) = sum;
  }
  return position;
}

double speed_of(const VectorXd& time, const VectorXd& position) {
  const Index last = position.size() - 1;
  const double squares = (position.tail(last) - position.head(last)).squaredNorm();
  return std::sqrt(squares * static_cast<double>(last)) / (time(last) - time(0));
}

}  // namespace

StandingDrive standing_drive_of_mass(const LumpedModel& model, const PredictionData& data) {
  StandingDrive result;
  if (!may_stand_by_friction_alone(model)) return result;
  const auto position = output_of(model, Quantity::kPosition),
             velocity = output_of(model, Quantity::kVelocity);
  if (!position && !velocity) return result;
  const auto output = static_cast<Index>(position ? *position : *velocity);
  for (const OutputErrorRecording& recording : data.recordings()) {
    if (recording.role != ExperimentRole::kEstimation || recording.time.size() < 2) continue;
    const VectorXd way =
        position_along(recording, output, position ? Quantity::kPosition : Quantity::kVelocity);
    const double step = position ? kSteps * data.rounding_step(output) : 0.0;
    const double band = std::max(step, kStill * kShortestStay * speed_of(recording.time, way));
    const std::vector<Stay> still = stays(recording.time, way, band, kShortestStay);
    result = larger(result, standing_drive(recording.time, recording.inputs.col(0), still));
  }
  return result;
}

}  // namespace graybox
