#include "diagnosis/second_looks/balance_beside.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "diagnosis/evidence/holding_friction.hpp"
#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/second_looks/answer_worth.hpp"
#include "diagnosis/second_looks/single_method.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

// Whatever the balance finds, a fault of the channels included, but for friction that takes all.
BalanceLook found_by_balance(const RigidRobotModel& drive, const DiagnosisRequest& request,
                             const Campaign& campaign) {
  BalanceLook look;
  try {
    DiagnosisAnswer answer = answer_by_drive(request, campaign, drive);
    const Diagnosis& diagnosis = answer.diagnosis;
    const bool is_faulty = !diagnosis.channel_faults.empty();
    if (!is_faulty) {
      look.was_stopped = diagnosis.interrupted;
      if (!look.was_stopped) look.error = error_of_balance(diagnosis);
    }
    const bool is_found = is_faulty || (!diagnosis.effects.empty() && !is_all_friction(answer));
    if (is_found) look.answer = std::move(answer);
  } catch (const InputError&) {
  }
  return look;
}

// Whether the balance is nearer to an answer than a prediction error that came to none.
bool is_worth_more(const Diagnosis& balanced, const RigidRobotModel& drive,
                   const DiagnosisAnswer& predicted) {
  constexpr double kFar = 10.0;  // times the limit of a test
  if (!balanced.channel_faults.empty()) return true;
  const std::optional<VerdictReason> holds = holding_reason(balanced.checked);
  if (holds && !holds->passed) return false;
  const double short_of = shortfall_of(predicted.diagnosis);
  const bool may_be = is_of_a_machine(balanced) || !drive.channels.velocity.empty();
  const bool is_nearer = shortfall_of(balanced) < short_of;
  if (may_be && (!predicted.by_prediction.doubt.empty() || is_nearer)) return true;
  return is_nearer && short_of > kFar;
}

// Whether the prediction error has found what takes nearly all of the force, and next to nothing of
// what is left depends on the motion. A balance can't find more then, and recordings that differ
// stay so.
bool accounts_for_force(const DiagnosisAnswer& predicted) {
  constexpr double kNearly = 10.0, kNextToNothing = 5.0;  // % of the forces that act
  const Diagnosis& diagnosis = predicted.diagnosis;
  const std::optional<double> left = force_left(diagnosis);
  const bool depends_on_motion =
      std::ranges::any_of(diagnosis.reasons, [](const VerdictReason& reason) {
        return reason.test.starts_with("force left that depends on") && has_failed(reason) &&
               reason.value.value_or(100.0) > kNextToNothing;
      });
  return predicted.by_prediction.doubt.empty() && !diagnosis.effects.empty() && left &&
         *left < kNearly && !depends_on_motion && is_of_a_machine(diagnosis) &&
         !has_signal_laws_only(diagnosis, predicted.hypotheses());
}

// Whether the balance is near an answer, and leaves about as little of the force as the prediction
// error that told signals.
bool tells_forces_as_well(const Diagnosis& balanced, double left) {
  constexpr double kAsMuch = 1.25;  // of the force that the prediction error leaves
  return balanced.channel_faults.empty() && balanced.verdict != Verdict::kUnknown &&
         is_of_a_machine(balanced) && balanced.validation_after &&
         balanced.validation_after->nrmse < kAsMuch * left;
}

}  // namespace

BalanceLook look_at_balance(const RigidRobotModel& drive, const DiagnosisRequest& request,
                            const Campaign& campaign, const DiagnosisAnswer& predicted) {
  if (accounts_for_force(predicted)) return {};
  if (predicted.diagnosis.verdict == Verdict::kUnknown) {
    BalanceLook look = found_by_balance(drive, request, campaign);
    if (look.answer && !is_worth_more(look.answer->diagnosis, drive, predicted)) {
      look.answer.reset();
    }
    return look;
  }
  const std::optional<double> left = force_left(predicted.diagnosis);
  if (!left || !has_signal_laws_only(predicted.diagnosis, predicted.hypotheses())) return {};
  BalanceLook look = found_by_balance(drive, request, campaign);
  if (look.answer && !tells_forces_as_well(look.answer->diagnosis, *left)) look.answer.reset();
  return look;
}

bool is_all_friction(const DiagnosisAnswer& balanced) {
  constexpr double kAll = 0.95;
  const FittedPhysics physics = fit_physics(*balanced.problem, balanced.diagnosis.after);
  return std::ranges::any_of(physics.quantities, [&](const PhysicalQuantity& quantity) {
    return quantity.kind == QuantityKind::kFriction && quantity.law < physics.laws.size() &&
           physics.laws[quantity.law].carried > 0.0 &&
           quantity.value > kAll * physics.laws[quantity.law].carried;
  });
}

void weigh_against_prediction(const DiagnosisAnswer& predicted, Diagnosis& balanced) {
  std::string laws;
  for (const FoundEffect& effect : predicted.diagnosis.effects) {
    const Hypothesis& law = predicted.hypotheses()[effect.law.hypothesis];
    laws += fmt::format("{}{} at {}", laws.empty() ? "" : ", ", law.law, law.place);
  }
  VerdictReason reason;
  reason.test = fmt::format("a diagnosis by prediction error finds something else ({})",
                            laws.empty() ? "nothing" : laws);
  reason.passed = false;
  reason.otherwise = Verdict::kAmbiguous;
  reason.next =
      "look at its answer, too (--method prediction_error); larger and faster motion "
      "tells forces from late signals";
  balanced.reasons.push_back(std::move(reason));
  balanced.verdict = verdict_of(balanced.reasons);
}

std::string reason_for_balance(const DiagnosisAnswer& predicted) {
  if (predicted.diagnosis.verdict != Verdict::kUnknown) {
    return "a diagnosis by prediction error finds late signals alone, and leaves as much force";
  }
  const std::string& doubt = predicted.by_prediction.doubt;
  const auto failure = std::ranges::find_if(predicted.diagnosis.reasons, has_failed);
  return fmt::format("a diagnosis by prediction error is in doubt (failed: {})",
                     doubt.empty() ? failure->test : doubt);
}

}  // namespace graybox
