#include "diagnosis/verdict/doubtful_effects.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/hypotheses/fit_physics.hpp"

namespace graybox {
namespace {

// A law with which nothing is predicted, however much worse it is without, was not found: what is
// left is larger than the signal, and no noise is known to be that large.
bool predicts_nothing(const FoundEffect& effect, const Diagnosis& diagnosis) {
  constexpr double kAll = 100.0;  // % of the signal
  return !diagnosis.noise_is_known && effect.held_out && effect.held_out->error_with >= kAll;
}

// A force several times what ever acted there stands in for something else.
bool exceeds_what_acted(const FittedLaw& law, const Diagnosis& diagnosis) {
  return std::ranges::any_of(diagnosis.implausible, [&](const Implausibility& flaw) {
    return flaw.rule == PlausibilityRule::kSize &&
           std::ranges::count(law.parameters, flaw.value, &LawParameterEstimate::value) > 0;
  });
}

// Where the noise is not known, recordings kept out must be predicted better with it.
bool gains_nothing_kept_out(const FoundEffect& effect, const Diagnosis& diagnosis) {
  return !diagnosis.noise_is_known && effect.held_out && !(effect.held_out->gain > 0.0);
}

// Where nothing was kept out, the fit must tell it from none.
bool is_hardly_seen(const FoundEffect& effect, const Diagnosis& diagnosis) {
  constexpr double kSeen = 2.0;  // z
  return !diagnosis.noise_is_known && !effect.held_out && !diagnosis.validation_after &&
         effect.bic_difference < kSeen * kSeen;
}

// A ripple with other explanations, of which it is not known where it pushes.
bool has_no_phase(const FoundEffect& effect) {
  constexpr double kKnown = 1.0;  // rad
  return !effect.rivals.empty() &&
         std::ranges::any_of(effect.law.parameters, [](const LawParameterEstimate& each) {
           return each.name == "phase" && each.unit == "rad" && each.standard_error > kKnown;
         });
}

// Whole recordings kept out are foretold worse with all that was found than with nothing.
bool is_worse_kept_out(const Diagnosis& diagnosis) {
  constexpr double kMuch = 15.0;  // % of the signal
  if (diagnosis.noise_is_known || !diagnosis.validation_before || !diagnosis.validation_after)
    return false;
  const double after = diagnosis.validation_after->nrmse;
  return after > kMuch && after > diagnosis.validation_before->nrmse;
}

// More acts unexplained than all that is known to act: no law's size is told then.
bool leaves_more_than_acts(const Diagnosis& diagnosis) {
  constexpr double kAll = 100.0;  // % of the forces that act
  return std::ranges::any_of(diagnosis.reasons, [](const VerdictReason& reason) {
    return reason.test.starts_with(kForceTest) && reason.value.value_or(0.0) > kAll;
  });
}

}  // namespace

bool has_no_size(const FittedLaw& law) {
  constexpr double kToldApart = 2.0;  // standard errors
  bool any = false;
  for (const LawParameterEstimate& estimate : law.parameters) {
    const double error = estimate.error();
    if (!sets_size(estimate) || !(error > 0.0)) continue;
    if (std::abs(estimate.value) > kToldApart * error) return false;
    any = true;
  }
  return any;
}

bool is_doubtful(const FoundEffect& effect, const Diagnosis& diagnosis) {
  return is_not_confirmed(effect) || predicts_nothing(effect, diagnosis) ||
         has_no_size(effect.law) || exceeds_what_acted(effect.law, diagnosis) ||
         gains_nothing_kept_out(effect, diagnosis) || leaves_more_than_acts(diagnosis) ||
         is_hardly_seen(effect, diagnosis) || has_no_phase(effect) || is_worse_kept_out(diagnosis);
}

bool has_no_confirmed_law(const Diagnosis& diagnosis) {
  return !diagnosis.effects.empty() && diagnosis.late_channels.empty() &&
         std::ranges::all_of(diagnosis.effects, [&](const FoundEffect& effect) {
           return is_doubtful(effect, diagnosis);
         });
}

}  // namespace graybox
