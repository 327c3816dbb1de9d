#include "diagnosis/search/law_selection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/search/candidate_ranking.hpp"
#include "diagnosis/search/law_pruning.hpp"
#include "diagnosis/search/law_rejection.hpp"
#include "diagnosis/search/plain_laws.hpp"
#include "diagnosis/search/renewal.hpp"

namespace graybox {
namespace {

// With m laws that may still come, one of them explains an m-th of what is left, or about: where
// the best does not explain this share of an m-th, all of them together won't, and they only stand
// in for one that is not in the catalogue.
constexpr double kShareOfAnMth = 0.5;

// Laws that may come together where none does by itself.
constexpr std::size_t kGroup = 4;

// Of BIC.
double enough_to_stand_out(const SearchState& state) {
  const double before =
      state.compare.bic(state.result.before) - state.compare.bic(state.result.after);
  return std::max(state.options.exclusion_margin, kImperfection * before);
}

// A small effect beside a large one drowns in the chi-square of all residuals where a test aimed at
// it still sees it. At a place that has its law, though, what is left is first of all that law's
// own imperfection.
bool points_elsewhere(const SearchState& state, const ScoreTable& table) {
  if (table.scores.empty()) return false;
  const HypothesisScore& best = table.scores.front();
  const auto is_there = [&](const FittedLaw& law) {
    return state.place_of(law.hypothesis) == state.place_of(best.start.hypothesis);
  };
  const auto count = static_cast<double>(state.problem->hypotheses().size());
  return best.score.p_value < state.options.level / count &&
         std::ranges::none_of(state.result.after.laws, is_there);
}

bool is_hopeless(const SearchState& state, const ExtendedFit& with) {
  const Assessment& left = state.result.after.estimation;
  if (!state.problem->noise_is_known() ||
      practical_size_p_value(left, state.options.tolerance) >= state.options.verification_level) {
    return false;
  }
  const auto still_to_come =
      static_cast<double>(state.effect_limit() - state.result.after.laws.size());
  return left.chi_square - with.estimation.chi_square <
         kShareOfAnMth * excess(state.result.after) / still_to_come;
}

// Of a law that has any.
bool has_size_of_no_more_than_error(const FittedLaw& law) {
  constexpr double kErrors = 2.0;
  if (std::ranges::none_of(law.parameters, sets_size)) return false;
  return std::ranges::none_of(law.parameters, [](const LawParameterEstimate& estimate) {
    return sets_size(estimate) && std::abs(estimate.value) > kErrors * estimate.error();
  });
}

// Where the fit leaves no more than noise already, as a whole: a law that recordings kept out know
// nothing of, or whose size is less than two of its errors, is none.
bool makes_no_difference(const SearchState& state, const ExtendedFit& without, const Trial& trial) {
  if (!state.compare.rest_is_noise(without)) return false;
  const FittedLaw& law = trial.fit.laws.back();
  if (has_size_of_no_more_than_error(law)) return true;
  const std::optional<HeldOutEffect> effect =
      held_out_effect(state, trial.hypothesis, without, trial.fit);
  return effect && effect->gain <= 0.0;
}

// The best of those that are significant. Where the noise is known, another where recordings kept
// out contradict that one; else the one of fewest parameters among those at its place that it does
// not excel (the rule of one standard error: Breiman and others 1984).
const Trial* choose(const SearchState& state, const ExtendedFit& without,
                    const std::vector<Trial>& trials) {
  const Trial* best = nullptr;
  const ExtendedFit* top = nullptr;
  for (const Trial& trial : trials) {
    if (!state.compare.significant(without, trial.fit)) continue;
    if (state.problem->noise_is_known() && (!state.compare.is_missed(without, trial.fit) ||
                                            makes_no_difference(state, without, trial))) {
      continue;
    }
    if (best == nullptr) {
      best = &trial;
      top = &trial.fit;
      if (state.problem->noise_is_known() && !state.compare.is_contradicted(trial.fit)) break;
      continue;
    }
    if (state.problem->noise_is_known()) {
      if (!state.compare.contradicts(best->fit, trial.fit)) continue;
      best = &trial;
      break;
    }
    const HeldOutGain gain = held_out_gain(trial.fit, *top);
    if (state.place_of(trial.hypothesis) == state.place_of(best->hypothesis) &&
        trial.fit.parameter_count < best->fit.parameter_count && gain.mean <= gain.standard_error) {
      best = &trial;
    }
  }
  return best;
}

// Each law from this one on.
bool each_is_missed(SearchState& state, const ExtendedFit& with, std::size_t first) {
  if (!state.compare.predicts_better(state.result.after, with, state.options.held_out_errors)) {
    return false;
  }
  for (std::size_t law = first; law < with.laws.size(); ++law) {
    const ExtendedFit without = fit_without(state, with, law);
    if (!without.usable || !state.compare.is_borne_out(without, with, law)) return false;
  }
  return true;
}

// Where the noise is not known and no law by itself predicts: a few that do so together. What one
// gains drowns in what the others have not explained yet (the harmonics of a ripple). Beside the
// others each must pass the test for a single law.
std::optional<ExtendedFit> group_of_laws(SearchState& state, std::vector<Trial> trials) {
  ExtendedFit with = state.result.after;
  for (std::size_t size = 1; size <= kGroup && with.laws.size() < state.effect_limit(); ++size) {
    if (trials.empty() || held_out_gain(with, trials.front().fit).mean <
                              state.compare.least_gain(with, trials.front().fit)) {
      return {};
    }
    with = std::move(trials.front().fit);
    if (size > 1 && each_is_missed(state, with, state.result.after.laws.size())) return with;
    trials = state.refits.refit_each(starts_of(with),
                                     shortlist(state, rank_hypotheses(state, with, 0)), with);
  }
  return {};
}

void add_laws(SearchState& state) {
  ScoreTable table;
  table.scores = state.result.ranking;
  while (state.result.after.laws.size() < state.effect_limit() && !state.result.interrupted) {
    bool is_small = false;  // what may still be missing
    if (!state.result.after.laws.empty()) {
      if (!state.proceed("testing all hypotheses again")) return;
      table = rank_hypotheses(state, state.result.after, 0);
      is_small = state.compare.rest_is_noise(state.result.after);
      if (is_small && !points_elsewhere(state, table)) return;
      if (!(is_small && state.problem->has_few()) && renew_with_laws(state)) continue;
    }
    const std::vector<LawStart> kept = starts_of(state.result.after);
    std::vector<LawStart> candidates =
        is_small ? small_shortlist(state, table, enough_to_stand_out(state))
                 : shortlist(state, table);
    // Few recordings can't tell small laws apart.
    std::vector<Trial> trials =
        is_small ? state.refits.refit_to_all(each_beside(kept, candidates), state.result.after)
                 : state.refits.refit_each(kept, candidates, state.result.after);
    const Trial* best = choose(state, state.result.after, trials);
    if (best == nullptr && !state.problem->noise_is_known() &&
        fill_up_shortlist(state, table, candidates)) {
      trials = state.refits.refit_each(kept, candidates, state.result.after);
      best = choose(state, state.result.after, trials);
    }
    if (best == nullptr && !state.problem->noise_is_known()) {
      if (std::optional<ExtendedFit> group = group_of_laws(state, trials)) {
        state.result.after = *std::move(group);
        state.settle_shapes();
        continue;
      }
    }
    if (is_small && (best == nullptr || !stands_out(state, best->fit))) return;
    if (best == nullptr && state.compounds_are_open) return;
    if (best == nullptr) {
      state.compounds_are_open = true;
      continue;
    }
    if (is_hopeless(state, best->fit)) return;
    state.result.after = best->fit;
    state.settle_shapes();
  }
}

std::set<int> ranks(const SearchState& state) {
  std::set<int> found;
  for (const Hypothesis& hypothesis : state.problem->hypotheses()) found.insert(hypothesis.rank);
  return found;
}

}  // namespace

void add_missing_laws(SearchState& state) {
  if (state.result.after.laws.empty()) {
    begin_with_plain_laws(state);
    for (const int rank : ranks(state)) {
      state.highest_rank = rank;
      state.compounds_are_open = false;
      add_laws(state);
    }
    state.highest_rank = std::numeric_limits<int>::max();
    end_with_plain_laws(state);
  } else {
    state.compounds_are_open = true;
    add_laws(state);
  }
  state.compounds_are_open = true;
}

bool stands_out(const SearchState& state, const ExtendedFit& with) {
  return state.compare.bic(state.result.after) - state.compare.bic(with) >
         enough_to_stand_out(state);
}

}  // namespace graybox
