#include "diagnosis/search/law_pruning.hpp"

#include <algorithm>
#include <utility>

#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/search/candidate_ranking.hpp"
#include "diagnosis/search/plainer_sums.hpp"

namespace graybox {
namespace {

bool is_better(const ExtendedFit& fit, const ExtendedFit& than) {
  return fit.usable && (!than.usable || fit.deviance < than.deviance);
}

std::vector<LawStart> starts_without(const ExtendedFit& fit, std::size_t law) {
  std::vector<LawStart> laws = starts_of(fit);
  laws.erase(laws.begin() + static_cast<std::ptrdiff_t>(law));
  return laws;
}

// Whoever leaves out one law goes on to the others: all at once they take less time.
void leave_out_each(SearchState& state, const ExtendedFit& fit) {
  if (!state.problem->fits_at_once()) return;
  std::vector<std::vector<LawStart>> asked;
  for (std::size_t law = 0; law < fit.laws.size(); ++law) asked.push_back(starts_without(fit, law));
  state.refits.refit_all(asked, fit);
}

}  // namespace

ExtendedFit fit_without(SearchState& state, const ExtendedFit& fit, std::size_t law) {
  std::vector<LawStart> laws = starts_without(fit, law);
  if (laws.empty()) return state.without_laws();
  leave_out_each(state, fit);
  ExtendedFit best = state.refits.refit(laws, fit);
  if (!state.problem->noise_is_known()) return best;
  for (LawStart& start : laws) {
    const auto ranked = std::ranges::find(state.result.ranking, start.hypothesis,
                                          [](const auto& score) { return score.start.hypothesis; });
    if (ranked != state.result.ranking.end() && !ranked->start.parameters.empty()) {
      start = ranked->start;
    }
  }
  const ExtendedFit other = state.refits.refit(laws, state.result.before);
  if (is_better(other, best)) best = other;
  // Laws can't make a fit worse than it is without any: that one began in another valley.
  if (!best.usable || best.deviance > state.result.before.deviance) {
    const ExtendedFit afresh = state.problem->fit(laws, nullptr);
    if (is_better(afresh, best)) best = afresh;
  }
  return best;
}

bool is_superfluous(const SearchState& state, const ExtendedFit& without) {
  if (!state.problem->noise_is_known()) {
    return !state.compare.predicts_better(without, state.result.after, kExclusionErrors);
  }
  return !state.compare.is_missed(without, state.result.after);
}

void prune_laws(SearchState& state) {
  for (std::size_t law = 0;
       law < state.result.after.laws.size() && state.result.after.laws.size() > 1;) {
    if (!state.proceed("leaving out " + state.name_of(state.result.after.laws[law].hypothesis))) {
      return;
    }
    ExtendedFit without = fit_without(state, state.result.after, law);
    if (without.usable && is_superfluous(state, without)) {
      state.result.after = std::move(without);
      law = 0;
    } else {
      ++law;
    }
  }
}

namespace {

// Whether a plainer law took its place.
bool give_way_to_special_case(SearchState& state, std::size_t law, const ExtendedFit& without) {
  const Hypothesis& richer = state.hypothesis(state.result.after.laws[law].hypothesis);
  if (richer.special_cases.empty()) return false;
  std::vector<LawStart> plainer;
  const auto is_plainer = [&richer](const Hypothesis& candidate) {
    return is_special_case(candidate, richer);
  };
  for (const HypothesisScore& score : rank_hypotheses(state, without, 0, is_plainer).scores) {
    if (can_be_refitted(state, score)) plainer.push_back(score.start);
  }
  if (plainer.empty()) return false;
  const std::vector<Trial> trials = state.refits.refit_each(starts_of(without), plainer, without);
  if (trials.empty() || trials.front().fit.parameter_count > state.result.after.parameter_count ||
      state.compare.keeps_its_place(state.result.after, law, trials.front().fit)) {
    return false;
  }
  state.result.after = trials.front().fit;
  return true;
}

bool give_way_to_sum(SearchState& state, std::size_t law, const ExtendedFit& without) {
  if (state.result.after.laws.size() >= state.effect_limit()) return false;
  const std::vector<ExtendedFit> sums = sums_of_plainer_laws(state, law, without);
  if (sums.empty() || !is_preferred(state, law, sums.front())) return false;
  state.result.after = sums.front();
  return true;
}

// The model found without two of its laws.
ExtendedFit fit_without_both(SearchState& state, std::size_t first, std::size_t second) {
  std::vector<LawStart> laws = starts_of(state.result.after);
  laws.erase(laws.begin() + static_cast<std::ptrdiff_t>(std::max(first, second)));
  laws.erase(laws.begin() + static_cast<std::ptrdiff_t>(std::min(first, second)));
  if (laws.empty()) return state.without_laws();
  return state.refits.refit(laws, state.result.after);
}

// Whether one law took the place of two at one place. A rare law may be no more than what a plain
// one leaves that came first, as the bend of a weight's force where a spring is.
bool give_way_to_one(SearchState& state, std::size_t rare, std::size_t other) {
  const ExtendedFit& after = state.result.after;
  const std::string place = state.place_of(after.laws[rare].hypothesis);
  const ExtendedFit without = fit_without_both(state, rare, other);
  if (!without.usable) return false;
  const auto is_there = [&](const Hypothesis& candidate) { return candidate.place == place; };
  std::vector<LawStart> candidates;
  for (const HypothesisScore& score : rank_hypotheses(state, without, 0, is_there).scores) {
    if (can_be_refitted(state, score)) candidates.push_back(score.start);
  }
  for (const Trial& trial : state.refits.refit_each(starts_of(without), candidates, without)) {
    const HeldOutGain gain = held_out_gain(trial.fit, after);
    const bool are_better =
        !(gain.mean <= std::max(state.options.held_out_gain, gain.standard_error));
    if (trial.fit.parameter_count >= after.parameter_count || are_better ||
        !state.compare.every_law_stands(trial.fit)) {
      continue;
    }
    state.result.after = trial.fit;
    return true;
  }
  return false;
}

void join_laws(SearchState& state) {
  const auto is_rare = [&](std::size_t law) {
    return state.hypothesis(state.result.after.laws[law].hypothesis).rank >= kRareRank;
  };
  for (std::size_t rare = 0; rare < state.result.after.laws.size(); ++rare) {
    for (std::size_t other = 0; other < state.result.after.laws.size(); ++other) {
      const std::vector<FittedLaw>& laws = state.result.after.laws;
      const bool share_place =
          state.place_of(laws[rare].hypothesis) == state.place_of(laws[other].hypothesis);
      const bool are_alike = laws[rare].hypothesis == laws[other].hypothesis;  // two harmonics
      if (rare == other || !is_rare(rare) || !share_place || are_alike) continue;
      if (!state.proceed("one law in the place of two")) return;
      if (give_way_to_one(state, rare, other)) {
        rare = static_cast<std::size_t>(-1);
        break;
      }
    }
  }
}

}  // namespace

void simplify_laws(SearchState& state) {
  if (!state.problem->noise_is_known()) join_laws(state);
  for (std::size_t law = 0; law < state.result.after.laws.size(); ++law) {
    const Hypothesis& found = state.hypothesis(state.result.after.laws[law].hypothesis);
    if (found.special_cases.empty() && state.problem->noise_is_known()) continue;
    const ExtendedFit without = fit_without(state, state.result.after, law);
    if (!without.usable) continue;
    // Recordings that do not determine a law may well determine a sum of plainer ones.
    const bool is_told =
        std::ranges::all_of(state.result.after.laws[law].parameters, is_determined);
    if ((!is_told && give_way_to_sum(state, law, without)) ||
        give_way_to_special_case(state, law, without) ||
        (is_told && give_way_to_sum(state, law, without))) {
      law = static_cast<std::size_t>(-1);  // the others stand in another order now
    }
  }
}

}  // namespace graybox
