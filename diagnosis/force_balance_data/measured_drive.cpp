#include "diagnosis/force_balance_data/measured_drive.hpp"

#include <algorithm>

namespace graybox {
namespace {

bool is_linear(const Element& part) {
  const LawEntry* entry = find_law(part.law_name, false);
  return part.location.kind == LocationKind::kElement &&
         part.location.input == part.location.output && entry != nullptr &&
         std::ranges::all_of(entry->parameters, &LawParameter::is_linear);
}

bool is_measured(const LumpedModel& model) {
  return model.mass_names.size() == 1 && !model.has_imposed_motion() &&
         model.is_driven_by_forces_alone() && model.inputs.size() == 1 &&
         std::ranges::all_of(model.parts, is_linear);
}

// Empty, or the channel of the one output of this quantity; false: there are several.
bool take_channel(const LumpedModel& model, LumpedOutput::Quantity quantity,
                  std::vector<std::string>& channel) {
  for (std::size_t k = 0; k < model.outputs.size(); ++k) {
    if (model.outputs[k].quantity == quantity) channel.push_back(model.output_names[k]);
  }
  return channel.size() <= 1;
}

bool take_channels(const LumpedModel& model, RobotChannels& channels) {
  using enum LumpedOutput::Quantity;
  channels.torque = model.input_names;
  channels.commanded_torque = true;
  if (!take_channel(model, kPosition, channels.position) ||
      !take_channel(model, kVelocity, channels.velocity) ||
      !take_channel(model, kAcceleration, channels.acceleration)) {
    return false;
  }
  const bool moves = !channels.position.empty() || !channels.velocity.empty();
  return moves && (channels.acceleration.empty() || !channels.velocity.empty()) &&
         channels.position.size() + channels.velocity.size() + channels.acceleration.size() ==
             model.outputs.size();
}

// Null: a mass that is zero has no parameter.
const LumpedParameter* mass_parameter(const LumpedModel& model) {
  return model.masses(0) > 0.0 ? &model.parameters.front() : nullptr;
}

RobotJoint joint_of(const LumpedModel& model) {
  RobotJoint joint;
  joint.name = model.mass_names.front();
  joint.is_prismatic = model.input_units.front() == "N";
  joint.body = RigidBody{};
  const LumpedParameter* mass = mass_parameter(model);
  if (mass == nullptr || mass->fixed) joint.rotor_inertia = mass == nullptr ? 0.0 : mass->value;
  return joint;
}

}  // namespace

std::optional<RigidRobotModel> measured_drive(const LumpedModel& model) {
  RigidRobotModel drive;
  if (!is_measured(model) || !take_channels(model, drive.channels)) return {};
  drive.name = model.name;
  drive.joints.push_back(joint_of(model));
  drive.transmission = Eigen::MatrixXd::Identity(1, 1);
  std::size_t next = mass_parameter(model) != nullptr ? 1 : 0;
  for (const Element& part : model.parts) {
    drive.elements.push_back(part);
    for (std::size_t p = 0; p < part.parameters.size(); ++p, ++next) {
      if (model.parameters[next].fixed) drive.known.push_back({drive.elements.size() - 1, p});
    }
  }
  return drive;
}

}  // namespace graybox
