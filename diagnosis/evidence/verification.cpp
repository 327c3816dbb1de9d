#include "diagnosis/evidence/verification.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "problems/base/distributions.hpp"

namespace graybox {
namespace {

// What the fit's own recordings may show beyond the noise, as a multiple of what others may: free
// motion is taken out of recordings with the model as it was.
constexpr double kFitTolerance = 2.0;

// Below the noise floor, or above it by chance.
bool is_predicted(const SearchState& state, const Assessment& held_out) {
  if (!std::isfinite(held_out.chi_square)) return false;
  return held_out.chi_square_per_dof() < state.options.noise_floor ||
         chi_square_tail(held_out.chi_square, held_out.degrees_of_freedom) >=
             state.options.verification_level;
}

bool none_failed(const SearchState& state) {
  return std::ranges::none_of(rest_reasons(state.result, state.options), has_failed);
}

void verify_without_noise(SearchState& state) {
  state.result.remaining_structure = state.problem->remaining_structure(state.result.after);
  state.result.autocorrelated_error = state.problem->autocorrelated_error(state.result.after);
  state.result.verified = none_failed(state);
}

void find_kept_out_change(SearchState& state) {
  Diagnosis& result = state.result;
  if (!result.validation_after || state.problem->noise_is_known()) return;
  const ExtendedFit own = state.problem->fit_to_kept_out(result.after);
  result.kept_out_change =
      kept_out_change(result.after, result.validation_after->nrmse, own, own.estimation.nrmse);
}

void find_trends(SearchState& state) {
  const ExtendedFit& after = state.result.after;
  state.result.trends = state.problem->trends(after);
  for (LawTrend& trend : state.result.trends) {
    const Hypothesis& hypothesis = state.problem->hypotheses()[after.laws[trend.law].hypothesis];
    trend.law_at = fmt::format("{} at {}", hypothesis.law, hypothesis.place);
  }
}

}  // namespace

void verify_rest(SearchState& state) {
  state.result.rest_test.was_made = !state.problem->noise_is_known();  // else further down
  state.result.validation_after = state.problem->validate(state.result.after);
  state.result.mismatch_after = state.problem->mismatch(state.result.after);
  state.result.channels_after = state.problem->channel_rests(state.result.after);
  state.problem->find_late_channels(state.result.after, state.result.channels_after);
  state.result.curves_after = state.problem->residual_curves(state.result.after);
  find_kept_out_change(state);
  if (!state.result.after.laws.empty()) {
    state.result.pictures = state.problem->force_pictures(state.result.after);
  }
  if (!state.problem->noise_is_known()) {
    find_trends(state);
    verify_without_noise(state);
    return;
  }
  state.result.verified = rest_passes(state);
  state.result.predicts =
      !state.result.validation_after || is_predicted(state, *state.result.validation_after);
}

bool rest_passes(SearchState& state) {
  state.result.rest_test.was_made = false;  // until it was: a stop may come between
  if (const auto prediction = state.problem->predict_held_out(state.result.after)) {
    state.result.validation_within_errors = prediction->within_errors;
  }
  state.result.rest_test.p_value = practical_size_p_value(
      state.result.validation_within_errors.value_or(state.result.after.estimation),
      state.options.tolerance);
  state.result.rest_test.fit_p_value = practical_size_p_value(
      state.result.after.estimation, kFitTolerance * state.options.tolerance);
  state.result.rest_test.was_made = true;
  return none_failed(state);
}

}  // namespace graybox
