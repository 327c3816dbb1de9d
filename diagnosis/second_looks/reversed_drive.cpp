#include "diagnosis/second_looks/reversed_drive.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/plausibility/plausibility.hpp"
#include "diagnosis/second_looks/answer_worth.hpp"
#include "diagnosis/second_looks/balance_beside.hpp"
#include "diagnosis/second_looks/single_method.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr double kAllOfForce = 100.0;  // % of the force

// The name of the one input of these recordings, which is counted the other way from here on; empty
// where there are several.
std::string turn_only_drive(Campaign& campaign) {
  std::string name;
  for (Channel& channel : campaign.channels) {
    if (channel.role != ChannelRole::kInput) continue;
    if (!name.empty()) return {};  // which of two?
    name = channel.name;
    channel.factor = -channel.factor;
  }
  return name;
}

// Whether a machine could be what was found once the drive was turned.
bool is_found(const DiagnosisAnswer& turned) {
  const Diagnosis& diagnosis = turned.diagnosis;
  return !diagnosis.effects.empty() && diagnosis.channel_faults.empty() && !diagnosis.interrupted &&
         excluding(diagnosis.implausible) == 0 && !is_all_friction(turned);
}

ChannelFault fault_of_sign(const std::string& name, double before, double after) {
  ChannelFault fault;
  fault.channels = {name};
  fault.message = fmt::format(
      "{0} has the wrong sign, or the motion has: turned, a balance of forces with what it then "
      "finds leaves {1:.3g} % of the force instead of {2:.3g} % (preprocess: [{{kind: sign, of: "
      "[{0}]}}])",
      name, after, before);
  fault.measure = "force that the balance leaves over the force";
  fault.dissimilarity_before = before / kAllOfForce;
  fault.dissimilarity_after = after / kAllOfForce;
  return fault;
}

}  // namespace

ReversedLook look_at_reversed_drive(const RigidRobotModel& drive, const DiagnosisRequest& request,
                                    const Campaign& campaign, std::optional<double> error) {
  constexpr double kClearly = 0.5, kWell = 50.0;  // of that error; % of the force
  ReversedLook look;
  Campaign turned = campaign;
  const std::string name = turn_only_drive(turned);
  if (name.empty()) return look;
  try {
    const DiagnosisAnswer answer = answer_by_drive(request, turned, drive);
    look.was_stopped = answer.diagnosis.interrupted;
    const double after = error_of_balance(answer.diagnosis), before = error.value_or(kAllOfForce);
    if (!is_found(answer) || !(after < kWell) || !(after < kClearly * before)) return look;
    look.fault = fault_of_sign(name, before, after);
  } catch (const InputError&) {
  }
  return look;
}

ReversedLook look_at_reversed_prediction(const DiagnosisRequest& request, const Campaign& campaign,
                                         const Diagnosis& first) {
  constexpr double kMost = 75.0, kClearly = 0.5;  // % of the forces that act; of what was left
  ReversedLook look;
  Campaign turned = campaign;
  const std::string name = turn_only_drive(turned);
  const std::optional<double> before = force_left(first);
  if (name.empty() || !before) return look;
  const Diagnosis answer = answer_by_prediction(request, turned).diagnosis;
  look.was_stopped = answer.interrupted;
  const bool is_answer = !answer.effects.empty() && answer.channel_faults.empty() &&
                         !answer.interrupted && excluding(answer.implausible) == 0;
  const double after = force_left(answer).value_or(0.0);
  if (!is_answer || !(after < kMost) || !(after < kClearly * *before)) return look;
  ChannelFault fault = fault_of_sign(name, *before, after);
  fault.message = fmt::format(
      "{0} has the wrong sign, or the motion has: turned, a diagnosis by prediction error with "
      "what "
      "it then finds leaves {1:.3g} % of the forces that act instead of {2:.3g} % (preprocess: "
      "[{{kind: sign, of: [{0}]}}])",
      name, after, *before);
  fault.measure = "force that the prediction leaves over the forces that act";
  look.fault = std::move(fault);
  return look;
}

void refuse(ChannelFault fault, const SearchOptions& options, Diagnosis& diagnosis) {
  Diagnosis refused;
  refused.channel_faults = {std::move(fault)};
  refused.channels_checked = true;
  refused.trouble = "the recordings are not what the channels say";
  refused.reasons = verdict_reasons(refused, options);
  refused.verdict = verdict_of(refused.reasons);
  diagnosis = std::move(refused);
}

}  // namespace graybox
