#include "diagnosis/second_looks/answer_worth.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "diagnosis/evidence/verdict_reasons.hpp"

namespace graybox {

bool is_of_a_machine(const Diagnosis& diagnosis) {
  const bool loses_the_mass = std::ranges::any_of(diagnosis.implausible, [](const auto& flaw) {
    return flaw.rule == PlausibilityRule::kZero &&
           (flaw.quantity.ends_with(".mass") || flaw.quantity.ends_with(".inertia"));
  });
  return excluding(diagnosis.implausible) == 0 && !loses_the_mass;
}

double shortfall_of(const Diagnosis& diagnosis) {
  constexpr double kOfCount = 3.0, kWithoutLaws = 1e3;
  double most = 0.0;
  for (const VerdictReason& reason : diagnosis.reasons) {
    if (!has_failed(reason)) continue;
    double own = kOfCount;
    const bool is_of_sizes = reason.test.starts_with("masses and springs");
    if (reason.otherwise == Verdict::kAmbiguous || is_of_sizes) {
      own = 1.0;
    } else if (reason.is_lower_limit) {
      own = kWithoutLaws;
    } else if (reason.value && reason.limit > 0.0) {
      own = *reason.value / reason.limit;
    }
    most = std::max(most, own);
  }
  return most;
}

std::optional<double> force_left(const Diagnosis& diagnosis) {
  for (const VerdictReason& reason : diagnosis.reasons) {
    if (reason.test.starts_with(kForceTest)) return reason.value;
  }
  return {};
}

double error_of_balance(const Diagnosis& diagnosis) {
  return diagnosis.validation_after ? diagnosis.validation_after->nrmse
                                    : diagnosis.after.estimation.nrmse;
}

bool has_signal_laws_only(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  constexpr std::array<std::string_view, 4> kSignals{"delay", "lag", "mode", "resonance"};
  return !diagnosis.effects.empty() &&
         std::ranges::all_of(diagnosis.effects, [&](const FoundEffect& effect) {
           return std::ranges::count(kSignals, hypotheses[effect.law.hypothesis].law) > 0;
         });
}

void tell_stopped(Diagnosis& diagnosis) {
  VerdictReason reason;
  reason.test = "the search came to its end (a second look, after the first had ended)";
  reason.passed = false;
  reason.next = "give it more time (--time-limit) or more threads";
  reason.otherwise = Verdict::kUnknown;
  diagnosis.reasons.insert(diagnosis.reasons.begin(), std::move(reason));
  diagnosis.interrupted = true;
  diagnosis.verdict = Verdict::kUnknown;
}

}  // namespace graybox
