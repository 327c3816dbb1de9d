#include "diagnosis/search/plainer_sums.hpp"

#include <algorithm>
#include <set>
#include <span>
#include <utility>

#include "diagnosis/search/candidate_ranking.hpp"

namespace graybox {
namespace {

constexpr std::size_t kPartners = 2;  // that are tried beside a plainer law

constexpr std::size_t kFewestParameters = 3;  // of a law that a sum may imitate

bool is_there(const ExtendedFit& fit, std::size_t hypothesis) {
  return std::ranges::find(fit.laws, hypothesis, &FittedLaw::hypothesis) != fit.laws.end();
}

// Laws at the place of the law found that are not in the fit, by their score tests: the best first.
std::vector<LawStart> ranked_there(const SearchState& state, const ExtendedFit& fit,
                                   const FittedLaw& found, std::size_t most_parameters) {
  std::vector<std::size_t> asked = open_hypotheses(state, fit);
  std::erase_if(asked, [&](std::size_t hypothesis) {
    return hypothesis == found.hypothesis ||
           state.place_of(hypothesis) != state.place_of(found.hypothesis);
  });
  ScoreTable table = state.problem->scores(fit, asked, 0, state.options.seed);
  std::ranges::stable_sort(table.scores, [](const HypothesisScore& a, const HypothesisScore& b) {
    return a.score.statistic > b.score.statistic;
  });
  std::vector<LawStart> starts;
  for (const HypothesisScore& score : table.scores) {
    if (can_be_refitted(state, score) && score.start.parameters.size() <= most_parameters &&
        !is_there(fit, score.start.hypothesis)) {
      starts.push_back(score.start);
    }
  }
  return starts;
}

// Special cases of the law and others of its characteristic, with fewer parameters.
std::vector<LawStart> plainer_laws(const SearchState& state, const FittedLaw& found,
                                   const ExtendedFit& without) {
  const Hypothesis& richer = state.hypothesis(found.hypothesis);
  std::vector<LawStart> plainer = ranked_there(state, without, found, found.parameters.size() - 1);
  std::erase_if(plainer, [&](const LawStart& start) {
    const Hypothesis& candidate = state.hypothesis(start.hypothesis);
    return !is_special_case(candidate, richer) &&
           (candidate.characteristic == Characteristic::kNone ||
            candidate.characteristic != richer.characteristic);
  });
  return plainer;
}

// What is missed most at the place beside the plainer law.
std::vector<LawStart> partners(const SearchState& state, const FittedLaw& found,
                               const ExtendedFit& with_plainer) {
  const std::size_t room = found.parameters.size() - with_plainer.laws.back().parameters.size();
  std::vector<LawStart> chosen = ranked_there(state, with_plainer, found, room);
  if (chosen.size() > kPartners) chosen.resize(kPartners);
  return chosen;
}

}  // namespace

std::vector<ExtendedFit> sums_of_plainer_laws(SearchState& state, std::size_t law,
                                              const ExtendedFit& without) {
  const FittedLaw found = state.result.after.laws[law];
  std::vector<ExtendedFit> sums;
  if (state.problem->noise_is_known() || !without.usable ||
      found.parameters.size() < kFewestParameters) {
    return sums;
  }
  const std::vector<LawStart> plainer = plainer_laws(state, found, without);
  if (plainer.empty() || !state.proceed("comparing " + state.name_of(found.hypothesis) +
                                        " with sums of plainer laws")) {
    return sums;
  }
  std::set<std::set<std::size_t>> tried;
  std::vector<std::vector<LawStart>> asked;
  for (const Trial& trial : state.refits.refit_each(starts_of(without), plainer, without)) {
    for (const LawStart& partner : partners(state, found, trial.fit)) {
      if (!tried.insert({trial.hypothesis, partner.hypothesis}).second) continue;
      asked.push_back(starts_of(trial.fit));
      asked.back().push_back(partner);
    }
  }
  for (Trial& trial : state.refits.refit_to_all(std::move(asked), without)) {
    if (state.compare.every_law_stands(trial.fit)) sums.push_back(std::move(trial.fit));
  }
  return sums;
}

bool is_preferred(const SearchState& state, std::size_t law, const ExtendedFit& sum) {
  if (state.compare.keeps_its_place(state.result.after, law, sum)) return false;
  const int rank = state.hypothesis(state.result.after.laws[law].hypothesis).rank;
  const bool is_of_lower_rank = std::ranges::all_of(
      std::span(sum.laws).last(2),
      [&](const FittedLaw& part) { return state.hypothesis(part.hypothesis).rank < rank; });
  if (is_of_lower_rank) return true;
  return sum.parameter_count < state.result.after.parameter_count ||
         held_out_gain(state.result.after, sum).mean > 0.0;
}

void add_rival_sums(const SearchState& state, FoundEffect& effect,
                    const std::vector<ExtendedFit>& sums) {
  bool is_named = false;
  for (const ExtendedFit& sum : sums) {
    Rival rival{.law = sum.laws[sum.laws.size() - 2],
                .bic_difference = state.compare.disadvantage(sum, state.result.after)};
    rival.with = {sum.laws.back()};
    if (!state.compare.excludes(state.result.after, sum)) {
      effect.rivals.push_back(std::move(rival));
    } else if (!is_named) {
      is_named = true;
      effect.excluded.push_back(std::move(rival));
    }
  }
}

}  // namespace graybox
