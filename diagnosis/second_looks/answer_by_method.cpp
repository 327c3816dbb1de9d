#include "diagnosis/second_looks/answer_by_method.hpp"

#include <optional>
#include <utility>

#include "diagnosis/plausibility/plausibility.hpp"
#include "diagnosis/second_looks/answer_worth.hpp"
#include "diagnosis/second_looks/balance_beside.hpp"
#include "diagnosis/second_looks/reversed_drive.hpp"
#include "diagnosis/second_looks/single_method.hpp"

namespace graybox {
namespace {

// Whether another method may be asked: nobody asked for this one, and nothing is settled already.
bool may_look_again(const DiagnosisRequest& request, const MethodChoice& method,
                    const Diagnosis& first) {
  return request.method == "auto" && method.drive && !first.interrupted &&
         first.channel_faults.empty();
}

// Whether what was foretold leaves more force than ever acted: the drive is not what moves it.
bool leaves_all_force(const Diagnosis& diagnosis) {
  constexpr double kAll = 100.0;  // % of the forces that act
  const std::optional<double> left = force_left(diagnosis);
  return diagnosis.verdict == Verdict::kUnknown && left && *left > kAll;
}

// Whether the sign of the drive is in doubt: no machine can be what the balance found, or neither
// method says what moves it.
bool doubts_sign(const DiagnosisRequest& request, const Diagnosis& first, const BalanceLook& look) {
  if (request.search.ignore_channel_faults || look.was_stopped) return false;
  return look.answer ? excluding(look.answer->diagnosis.implausible) > 0 : leaves_all_force(first);
}

// The balance answers in place of the prediction error, which is weighed against it where it may be
// right.
MethodAnswer answer_of_balance(MethodChoice method, const DiagnosisAnswer& predicted,
                               DiagnosisAnswer balanced) {
  const bool may_be_right =
      predicted.by_prediction.doubt.empty() && !predicted.diagnosis.effects.empty();
  if (may_be_right) weigh_against_prediction(predicted, balanced.diagnosis);
  method.name = "force_balance";
  method.reason = reason_for_balance(predicted);
  return {std::move(method), std::move(balanced)};
}

MethodAnswer answer_by_prediction_first(MethodChoice method, const DiagnosisRequest& request,
                                        const Campaign& campaign) {
  DiagnosisAnswer predicted = answer_by_prediction(request, campaign);
  if (!may_look_again(request, method, predicted.diagnosis)) {
    return {std::move(method), std::move(predicted)};
  }
  BalanceLook look = look_at_balance(*method.drive, request, campaign, predicted);
  if (doubts_sign(request, predicted.diagnosis, look)) {
    ReversedLook reversed = look_at_reversed_drive(*method.drive, request, campaign, look.error);
    look.was_stopped = reversed.was_stopped;
    const bool may_be_told = !reversed.fault && !look.was_stopped && !look.answer &&
                             leaves_all_force(predicted.diagnosis);
    if (may_be_told) {
      reversed = look_at_reversed_prediction(request, campaign, predicted.diagnosis);
      look.was_stopped = reversed.was_stopped;
    }
    if (reversed.fault) {
      refuse(*std::move(reversed.fault), request.search, predicted.diagnosis);
      return {std::move(method), std::move(predicted)};
    }
  }
  if (look.answer) {
    return answer_of_balance(std::move(method), predicted, *std::move(look.answer));
  }
  if (look.was_stopped) tell_stopped(predicted.diagnosis);
  return {std::move(method), std::move(predicted)};
}

}  // namespace

MethodAnswer answer_by(MethodChoice method, const DiagnosisRequest& request,
                       const Campaign& campaign) {
  if (method.name == "prediction_error") {
    return answer_by_prediction_first(std::move(method), request, campaign);
  }
  DiagnosisAnswer answer = method.name == "force_balance" && method.drive
                               ? answer_by_drive(request, campaign, *method.drive)
                               : answer_by_problem(request, campaign);
  return {std::move(method), std::move(answer)};
}

}  // namespace graybox
