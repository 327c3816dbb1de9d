#include "graybox/diagnosis/search/plainer_sums.hpp"

#include <algorithm>
#include <set>
#include <span>
#include <utility>

#include "graybox/diagnosis/search/candidate_ranking.hpp"

namespace graybox {
namespace {

constexpr std::size_t kPartners = 2;  // that are tried beside a plainer law

bool is_there(const ExtendedFit& fit, std::size_t hypothesis) {
  return std::ranges::find(fit.laws, hypothesis, &FittedLaw::hypothesis) != fit.laws.end();
}

// Special cases of the law and others of its characteristic, with fewer parameters.
std::vector<LawStart> plainer_laws(const SearchState& state, const FittedLaw& found,
                                   const ExtendedFit& without) {
  const Hypothesis& richer = state.hypothesis(found.hypothesis);
  std::vector<LawStart> plainer;
  for (const HypothesisScore& score : rank_hypotheses(state, without, 0).scores) {
    const Hypothesis& candidate = state.hypothesis(score.start.hypothesis);
    const bool is_kin = is_special_case(candidate, richer) ||
                        (candidate.place == richer.place &&
                         candidate.characteristic != Characteristic::kNone &&
                         candidate.characteristic == richer.characteristic);
    if (is_kin && can_be_refitted(state, score) && !is_there(without, score.start.hypothesis) &&
        score.start.parameters.size() < found.parameters.size()) {
      plainer.push_back(score.start);
    }
  }
  return plainer;
}

// What is missed most at the place beside the plainer law.
std::vector<LawStart> partners(const SearchState& state, const FittedLaw& found,
                               const ExtendedFit& with_plainer) {
  const std::size_t room =
      found.parameters.size() - with_plainer.laws.back().parameters.size();
  std::vector<LawStart> chosen;
  for (const HypothesisScore& score : rank_hypotheses(state, with_plainer, 0).scores) {
    if (chosen.size() == kPartners) break;
    if (state.place_of(score.start.hypothesis) == state.place_of(found.hypothesis) &&
        score.start.hypothesis != found.hypothesis && can_be_refitted(state, score) &&
        !is_there(with_plainer, score.start.hypothesis) &&
        score.start.parameters.size() <= room) {
      chosen.push_back(score.start);
    }
  }
  return chosen;
}

}  // namespace

std::vector<ExtendedFit> sums_of_plainer_laws(SearchState& state, std::size_t law,
                                              const ExtendedFit& without) {
  const FittedLaw found = state.result.after.laws[law];
  std::vector<ExtendedFit> sums;
  if (state.problem->noise_is_known() || !without.usable || found.parameters.size() < 2) {
    return sums;
  }
  const std::vector<LawStart> plainer = plainer_laws(state, found, without);
  if (plainer.empty() ||
      !state.proceed("comparing " + state.name_of(found.hypothesis) + " with sums of plainer laws")) {
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

bool is_preferred(const SearchState& state, const ExtendedFit& sum) {
  if (state.compare.excludes(state.result.after, sum)) return false;
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
