#include "diagnosis/search/first_fit.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "diagnosis/search/candidate_ranking.hpp"
#include "diagnosis/search/renewal.hpp"

namespace graybox {
namespace {

// Fits of the model as it is after the first, each from so many refits; what must come of it.
constexpr int kFirstFits = 3;
constexpr std::size_t kTriedTrials = 3;
constexpr double kShortOfOptimum = 1.0;  // of the deviance
constexpr double kStillMissing = 0.5;    // of what chi-square has too much

// There the model alone comes nowhere near: it was not the fit that stopped short.
bool stays_far_off(const ExtendedFit& before, const ExtendedFit& again) {
  return excess(again) >
         std::max(kStillMissing * excess(before), again.estimation.degrees_of_freedom);
}

// The model alone, from the parameters of a law that explains all.
bool stays_far_off_on_few(SearchState& state, const ExtendedFit& with_law) {
  const std::optional<ExtendedFit> before = state.problem->fit_to_few({}, state.result.before);
  if (!before || !before->usable) return false;
  const std::optional<ExtendedFit> again = state.problem->fit_to_few({}, with_law);
  return again && again->usable && stays_far_off(*before, *again);
}

}  // namespace

bool fit_as_it_is(SearchState& state) {
  state.proceed("fitting the model as it is");
  state.result.before = state.problem->fit({}, nullptr);
  if (!state.result.before.usable) {
    state.result.after = state.result.before;
    if (!state.proceed("looking at the fit")) return false;  // it was stopped in the fit
    state.result.trouble = "the model as it is can't be fitted: " + state.result.before.trouble;
    return false;
  }
  state.describe_fit_as_it_is();
  return true;
}

bool fit_better(SearchState& state) {
  if (!state.problem->noise_is_known() || state.first_fits == kFirstFits) return false;
  ++state.first_fits;
  ScoreTable table;
  table.scores = state.result.ranking;
  const std::vector<Trial> trials =
      state.refits.refit_each({}, shortlist(state, table), state.result.before);
  // The parameters of a law that explains all are the right ones, if any are.
  const bool is_explained = !trials.empty() && state.compare.rest_is_noise(trials.front().fit);
  if (is_explained && stays_far_off_on_few(state, trials.front().fit)) return false;
  const std::size_t tried = is_explained ? 1 : std::min(kTriedTrials, trials.size());
  ExtendedFit best = state.result.before;
  for (std::size_t i = 0; i < tried; ++i) {
    if (!state.proceed("fitting the model as it is once more")) return false;
    ExtendedFit again = state.problem->fit({}, &trials[i].fit);
    if (again.usable && again.deviance < best.deviance) best = std::move(again);
  }
  if (best.deviance > state.result.before.deviance - kShortOfOptimum) return false;
  if (is_explained && stays_far_off(state.result.before, best)) return false;
  state.result.before = std::move(best);
  state.refits.forget();
  renew_without_laws(state);
  state.describe_fit_as_it_is();
  return true;
}

}  // namespace graybox
