#include "diagnosis/search/rival_weighing.hpp"

#include <algorithm>
#include <iterator>
#include <span>
#include <utility>

#include "diagnosis/evidence/verification.hpp"
#include "diagnosis/search/candidate_ranking.hpp"
#include "diagnosis/search/explanation_class.hpp"
#include "diagnosis/search/law_pruning.hpp"
#include "diagnosis/search/plainer_sums.hpp"
#include "diagnosis/search/renewal.hpp"

namespace graybox {
namespace {

// Exchanges of laws for better ones where the noise is known; each lowers BIC.
constexpr int kExchanges = 4;

void forget_effects(SearchState& state) {
  state.result.effects.clear();
  state.class_fits.clear();
}

// A trial of another law than the one found: one that excludes it, with recordings kept out; else,
// where there are several laws, one of lower BIC that does not merely generalise it.
const Trial* better_than_found(const SearchState& state, const FoundEffect& effect,
                               const std::vector<Trial>& trials) {
  if (!state.problem->noise_is_known()) return nullptr;
  const auto speaks = std::ranges::find_if(trials, [&](const Trial& trial) {
    return state.compare.excludes(trial.fit, state.result.after);
  });
  if (speaks != trials.end()) return &*speaks;
  if (state.result.after.laws.size() < 2) return nullptr;
  const std::span<const Hypothesis> all = state.problem->hypotheses();
  const Trial* best = nullptr;
  for (const Trial& trial : trials) {
    if (is_special_case(all[effect.law.hypothesis], all[trial.hypothesis])) continue;
    if (state.compare.contradicts(trial.fit, state.result.after)) continue;
    if (state.compare.bic(trial.fit) <
        (best == nullptr ? state.compare.bic(state.result.after) : state.compare.bic(best->fit))) {
      best = &trial;
    }
  }
  return best;
}

double share_explained(const ExtendedFit& without, const ExtendedFit& with) {
  const double gain = without.estimation.chi_square - with.estimation.chi_square;
  return excess(without) > gain ? gain / excess(without) : 1.0;
}

bool is_repeatable(const SearchState& state, std::size_t hypothesis) {
  return state.hypothesis(hypothesis).repeatable;
}

// All laws at a place where none of those found there is quite right.
std::vector<LawStart> candidates_for(const SearchState& state, std::size_t found,
                                     const ScoreTable& table) {
  std::vector<LawStart> candidates = shortlist(state, table);
  const std::string& place = state.place_of(found);
  if (state.departed_places.count(place) == 0) return candidates;
  for (const HypothesisScore& score : table.scores) {
    if (state.place_of(score.start.hypothesis) == place && can_be_refitted(state, score) &&
        std::ranges::find(candidates, score.start) == candidates.end()) {
      candidates.push_back(score.start);
    }
  }
  return candidates;
}

// Where the model without the law can't be fitted, candidates are those of the first ranking, and
// start beside the other laws as they are.
std::vector<Trial> rivals_of(SearchState& state, std::size_t law, const ExtendedFit& without,
                             std::vector<Rival>& outpaced) {
  const std::size_t found = state.result.after.laws[law].hypothesis;
  if (!state.proceed("weighing rivals of " + state.name_of(found))) return {};
  std::vector<LawStart> others = starts_of(without.usable ? without : state.result.after);
  if (!without.usable) others.erase(others.begin() + static_cast<std::ptrdiff_t>(law));
  ScoreTable table;
  table.scores = state.result.ranking;
  if (without.usable && !without.laws.empty()) table = rank_hypotheses(state, without, 0);
  std::vector<LawStart> candidates;
  LawStart pace = starts_of(state.result.after)[law];
  std::vector<LawStart> asked = candidates_for(state, found, table);
  if (!state.problem->noise_is_known()) asked = comparable(std::move(asked), table, found);
  for (const LawStart& start : asked) {
    if (start.hypothesis == found) pace = start;
    if (others.empty() && was_far_behind(state, start.hypothesis, found, outpaced)) continue;
    if (!may_stand_in(state.hypothesis(start.hypothesis), state.hypothesis(found))) continue;
    const bool is_there =
        std::ranges::find(others, start.hypothesis, &LawStart::hypothesis) != others.end();
    if (start.hypothesis != found && (!is_there || is_repeatable(state, start.hypothesis))) {
      candidates.push_back(start);
    }
  }
  add_more_general(state, found, table, candidates);
  std::vector<Rival> on_few;
  std::vector<Trial> trials = state.refits.refit_each(
      others, candidates, without.usable ? without : state.result.after, &pace, &on_few);
  std::ranges::move(on_few, std::back_inserter(outpaced));
  std::ranges::stable_sort(outpaced, {}, &Rival::bic_difference);
  if (state.problem->noise_is_known()) {
    std::ranges::stable_sort(trials, {}, [&](const Trial& trial) {
      return state.compare.evidence_of_all(trial.fit, state.result.after);
    });
  }
  return trials;
}

}  // namespace

void weigh_rivals(SearchState& state) {
  forget_effects(state);
  // As many laws as may be, and what they leave is no noise: rivals are no likelier physics.
  state.result.rivals_weighed = !state.problem->noise_is_known() ||
                                state.result.after.laws.size() < state.effect_limit() ||
                                rest_passes(state);
  int exchanges = 0;
  for (std::size_t law = 0; law < state.result.after.laws.size(); ++law) {
    const auto weigh_again_with = [&](const ExtendedFit& fit) {
      state.result.after = fit;
      forget_effects(state);
      law = static_cast<std::size_t>(-1);
    };
    FoundEffect effect;
    effect.law = state.result.after.laws[law];
    const ExtendedFit without = fit_without(state, state.result.after, law);
    // Beside what has taken another's place it may no longer be missed.
    if (exchanges > 0 && state.result.after.laws.size() > 1 && without.usable &&
        is_superfluous(state, without)) {
      weigh_again_with(without);
      continue;
    }
    if (without.usable) {
      effect.bic_difference = state.compare.disadvantage(without, state.result.after);
      effect.explained_share = share_explained(without, state.result.after);
    }
    if (state.result.rivals_weighed) {
      std::vector<Rival> outpaced;
      const std::vector<Trial> trials = rivals_of(state, law, without, outpaced);
      const Trial* better = better_than_found(state, effect, trials);
      if (better != nullptr && exchanges++ < kExchanges) {
        weigh_again_with(better->fit);
        continue;
      }
      divide_rivals(state, effect, trials);
      add_rival_sums(state, effect, sums_of_plainer_laws(state, law, without));
      std::ranges::move(outpaced, std::back_inserter(effect.excluded));
    }
    add_twins(state, effect);
    keep_best_generalisations(effect);
    state.result.effects.push_back(std::move(effect));
  }
}

}  // namespace graybox
