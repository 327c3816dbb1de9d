#include "diagnosis/search/diagnosis_search.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "diagnosis/evidence/holding_friction.hpp"
#include "diagnosis/evidence/search_state.hpp"
#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/evidence/verification.hpp"
#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/search/first_fit.hpp"
#include "diagnosis/search/late_channels.hpp"
#include "diagnosis/search/law_exchange.hpp"
#include "diagnosis/search/law_pruning.hpp"
#include "diagnosis/search/law_rejection.hpp"
#include "diagnosis/search/law_selection.hpp"
#include "diagnosis/search/mismatch_detection.hpp"
#include "diagnosis/search/rival_weighing.hpp"
#include "diagnosis/search/shape_check.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

bool has_channel_faults(SearchState& state) {
  const bool has_time = state.proceed("checking wires, signs and units");
  state.result.channel_faults = state.problem->channel_faults();
  state.result.channels_checked = has_time && state.proceed("wires, signs and units are checked");
  if (state.result.channel_faults.empty()) return false;
  state.result.trouble = "the recordings are not what the channels say";
  return true;
}

constexpr int kSearches = 6;  // each without the laws that were rejected before

void find_and_exchange_laws(SearchState& state) {
  add_missing_laws(state);
  prune_laws(state);
  simplify_laws(state);
  if (!state.problem->noise_is_known()) exchange_laws(state);
  prune_laws(state);  // beside laws made plainer another may no longer be missed
  state.settle_shapes();
  if (state.problem->noise_is_known()) weigh_rivals(state);  // which may exchange laws
}

void find_laws(SearchState& state) {
  for (int search = 0; search < kSearches; ++search) {
    find_and_exchange_laws(state);
    const Rejection rejection = reject_laws(state);
    if (rejection == Rejection::kNone && state.problem->noise_is_known()) return;
    if (rejection != Rejection::kSome || !state.proceed("searching without what was rejected")) {
      break;
    }
  }
  weigh_rivals(state);
}

void judge_plausibility(SearchState& state) {
  state.result.checked = checked_range(*state.problem);
  if (!state.proceed("judging what was fitted") || !state.result.after.usable) return;
  state.result.implausible = implausibilities(fit_physics(*state.problem, state.result.after));
  state.result.plausibility_judged = true;
}

// Whatever was found, models that do not depend on time do not describe what does.
void look_for_change(SearchState& state) {
  if (!state.proceed("looking for what changes with time")) return;
  std::optional<TimeVariation> variation = state.problem->time_variation(
      state.result.after, state.result.before.deviance - state.result.after.deviance);
  state.result.time_variation_was_tested = variation.has_value();
  if (variation && variation->p_value < state.options.variation_level) {
    state.result.time_variation = std::move(variation);
    state.result.detection.detected = true;
  }
}

// A test of single hypotheses that no law bears out on recordings kept out, where all that the
// model leaves is no more than noise, here and there: by such tests noise that is not quite as it
// was estimated looks like physics.
void withdraw_what_nothing_bears_out(SearchState& state) {
  const Diagnosis& result = state.result;
  if (!state.problem->noise_is_known() || result.interrupted || !result.after.laws.empty() ||
      !result.validation_before ||
      result.detection.lack_of_fit_p_value < 0.5 * state.options.level) {
    return;
  }
  const Assessment& kept_out = *result.validation_before;
  if (chi_square_tail(kept_out.chi_square, kept_out.degrees_of_freedom) >=
      state.options.verification_level) {
    state.result.detection.detected = false;
  }
}

// Laws that bodies which are not as stated would ask for. One payload is the plainer explanation;
// with inertias of joints beside it the drawing is.
bool adds_a_body(const Hypothesis& hypothesis) {
  return hypothesis.law == "payload" || hypothesis.law == "inertia";
}

// Bodies that a model states as certain: told, and not freed, where that takes a third of the
// squared error kept out and predicts blocks clearly better. Several laws that add bodies are left
// out then, if the error with free bodies is no larger than with them.
void doubt_stated_bodies(SearchState& state) {
  constexpr double kWorthTelling = 1.0 / 3.0, kErrors = 3.0, kAsWell = 1.1;
  const ExtendedFit& found = state.result.after;
  if (state.problem->noise_is_known() || state.result.freed_model || !found.usable) return;
  const std::optional<Assessment> with_all = state.problem->validate(found);
  if (!with_all || !state.proceed("asking whether the bodies are as stated")) return;
  const std::unique_ptr<MismatchProblem> freed = state.problem->with_doubted_model(found);
  if (!freed) return;
  std::vector<LawStart> kept;
  FreedModel doubted;
  doubted.on_kept_out = true;
  for (const LawStart& law : starts_of(found)) {
    const bool adds = adds_a_body(state.hypothesis(law.hypothesis));
    if (adds) doubted.instead_of.push_back(state.name_of(law.hypothesis));
    if (!adds) kept.push_back(law);
  }
  if (doubted.instead_of.size() < 2) {
    doubted.instead_of.clear();
    kept = starts_of(found);
  }
  const ExtendedFit stated = doubted.instead_of.empty() ? found : state.problem->fit(kept, nullptr);
  const ExtendedFit fit = freed->fit(kept, nullptr);
  if (!fit.usable || !stated.usable) return;
  const std::optional<Assessment> before = state.problem->validate(stated),
                                  after = freed->validate(fit);
  const auto square = [](double error) { return error * error; };
  const bool is_better = before && after &&
                         square(after->nrmse) < (1.0 - kWorthTelling) * square(before->nrmse) &&
                         after->nrmse <= kAsWell * with_all->nrmse &&
                         state.compare.predicts_better(stated, fit, kErrors);
  if (!is_better) return;
  doubted.error_stated = before->nrmse;
  doubted.error_freed = after->nrmse;
  doubted.departures = freed->departures_from_stated(fit);
  state.result.doubted_model = std::move(doubted);
}

void search(SearchState& state) {
  if (!state.options.ignore_channel_faults && has_channel_faults(state)) return;
  if (!fit_as_it_is(state)) return;
  detect_mismatch(state);
  while (state.result.detection.detected && fit_better(state)) detect_mismatch(state);
  if (state.result.detection.detected) {
    find_laws(state);
    find_laws_in_time(state, find_laws);
    withdraw_what_nothing_bears_out(state);
  }
  verify_rest(state);
  look_for_departures(state);
  look_for_change(state);
  note_held_out_effects(state);
  if (state.result.freed_model) {
    state.result.freed_model->departures =
        state.problem->departures_from_stated(state.result.after);
  }
  doubt_stated_bodies(state);
  judge_plausibility(state);
}

}  // namespace

Diagnosis diagnose(const MismatchProblem& problem, const SearchOptions& options) {
  SearchState state(problem, options);
  state.result.plausibility_judged = false;
  state.result.rest_test.was_made = false;
  try {
    search(state);
  } catch (const Stopped&) {  // in the middle of a step
    state.result.interrupted = true;
    if (!state.result.after.usable) state.result.after = state.result.before;
  }
  add_holding_friction(problem.hypotheses(), state.result);
  state.result.reasons = verdict_reasons(state.result, options);
  state.result.verdict = verdict_of(state.result.reasons);
  return std::move(state.result);
}

}  // namespace graybox
