#include "graybox/diagnosis/search/diagnosis_search.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "graybox/diagnosis/search/first_fit.hpp"
#include "graybox/diagnosis/search/law_exchange.hpp"
#include "graybox/diagnosis/search/law_pruning.hpp"
#include "graybox/diagnosis/search/law_selection.hpp"
#include "graybox/diagnosis/search/mismatch_detection.hpp"
#include "graybox/diagnosis/search/rival_weighing.hpp"
#include "graybox/diagnosis/search/search_state.hpp"
#include "graybox/diagnosis/search/shape_check.hpp"
#include "graybox/diagnosis/search/verification.hpp"

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

void find_laws(SearchState& state) {
  add_missing_laws(state);
  prune_laws(state);
  simplify_laws(state);
  if (!state.problem->noise_is_known()) exchange_laws(state);
  prune_laws(state);  // beside laws made plainer another may no longer be missed
  weigh_rivals(state);
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

Verdict verdict_of(const Diagnosis& result) {
  if (!result.detection.detected) return result.interrupted ? Verdict::kUnknown : Verdict::kNone;
  if (result.effects.empty() || !result.verified || result.time_variation ||
      !result.departures.empty() || !result.shared_characteristics.empty() || result.interrupted) {
    return Verdict::kUnknown;
  }
  const auto has_rivals = [](const FoundEffect& effect) {
    return !effect.rivals.empty() || !effect.same_at.empty();
  };
  const bool is_clear = result.predicts && std::ranges::none_of(result.effects, has_rivals);
  return is_clear ? Verdict::kExplained : Verdict::kAmbiguous;
}

}  // namespace

Diagnosis diagnose(const MismatchProblem& problem, const SearchOptions& options) {
  SearchState state(problem, options);
  if (!options.ignore_channel_faults && has_channel_faults(state)) return std::move(state.result);
  if (!fit_as_it_is(state)) return std::move(state.result);
  detect_mismatch(state);
  while (state.result.detection.detected && fit_better(state)) detect_mismatch(state);
  if (state.result.detection.detected) find_laws(state);
  verify_rest(state);
  look_for_departures(state);
  look_for_change(state);
  state.result.verdict = verdict_of(state.result);
  return std::move(state.result);
}

}  // namespace graybox
