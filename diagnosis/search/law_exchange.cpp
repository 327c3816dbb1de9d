#include "diagnosis/search/law_exchange.hpp"

#include "diagnosis/search/candidate_ranking.hpp"
#include "diagnosis/search/law_pruning.hpp"
#include "diagnosis/search/law_selection.hpp"

namespace graybox {
namespace {

bool exchange_one_law(SearchState& state) {
  for (std::size_t law = 0; law < state.result.after.laws.size(); ++law) {
    const ExtendedFit without = fit_without(state, state.result.after, law);
    if (!without.usable ||
        !state.proceed("exchanging " + state.name_of(state.result.after.laws[law].hypothesis))) {
      continue;
    }
    std::vector<LawStart> candidates;
    const std::size_t found = state.result.after.laws[law].hypothesis;
    const ScoreTable table = rank_hypotheses(state, without, 0);
    for (const LawStart& start : comparable(shortlist(state, table), table, found)) {
      if (start.hypothesis == found) continue;
      if (!may_stand_in(state.hypothesis(start.hypothesis), state.hypothesis(found))) continue;
      candidates.push_back(start);
    }
    const std::vector<Trial> trials =
        state.refits.refit_each(starts_of(without), candidates, without);
    if (trials.empty() || !state.compare.every_law_stands(trials.front().fit) ||
        !state.compare.predicts_better(state.result.after, trials.front().fit,
                                       state.options.held_out_errors)) {
      continue;
    }
    state.result.after = trials.front().fit;
    return true;
  }
  return false;
}

}  // namespace

void exchange_laws(SearchState& state) {
  constexpr int kRounds = 12;
  for (int round = 0; round < kRounds && exchange_one_law(state); ++round) {
    add_missing_laws(state);
    prune_laws(state);
    simplify_laws(state);
  }
}

}  // namespace graybox
