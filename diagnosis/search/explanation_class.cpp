#include "diagnosis/search/explanation_class.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "diagnosis/search/candidate_ranking.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

// One law at two places is the same to every experiment of a kind where fits with it differ by no
// more than the first in deviance (they stop where a step gains a tenth), and where with the best
// further experiment the two would be no farther apart than the second: about 20 excludes a rival
// (next_experiment.hpp), so a thousand times the recordings would be needed.
constexpr double kSameDeviance = 1.0;
constexpr double kSameDistance = 0.02;

// Less of -2 log evidence in favour of a law that generalises another is "not worth more than a
// bare mention" (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995).
constexpr double kAskedFor = 2.0;

constexpr double kRarerErrors = 2.0;

// Names of an effect, up to which generalisations are among them: more names say less.
constexpr std::size_t kNames = 3;

// Where the last law of this fit is that of a member of the class, at a place that no experiment of
// this kind would tell from the member's: the member's list of such places.
std::vector<FittedLaw>* same_law_among(const SearchState& state,
                                       const std::vector<const ExtendedFit*>& members,
                                       const ExtendedFit& fit, FoundEffect& effect) {
  if (!state.problem->noise_is_known()) return nullptr;  // the distance is in units of the noise
  const std::span<const Hypothesis> all = state.problem->hypotheses();
  for (std::size_t m = 0; m < members.size(); ++m) {
    const FittedLaw& law = m == 0 ? effect.law : effect.rivals[m - 1].law;
    if (all[law.hypothesis].law != all[fit.laws.back().hypothesis].law ||
        std::abs(members[m]->deviance - fit.deviance) > kSameDeviance) {
      continue;
    }
    const auto experiments = state.problem->experiments_between(*members[m], fit);
    if (!experiments || experiments->distance_at_best > kSameDistance) continue;
    return m == 0 ? &effect.same_at : &effect.rivals[m - 1].same_at;
  }
  return nullptr;
}

// The least among the law found and others in its place of which this one is a generalisation.
std::optional<double> evidence_of_special_cases(const SearchState& state, const Trial& trial,
                                                const FoundEffect& effect,
                                                const std::vector<const Trial*>& others) {
  const std::span<const Hypothesis> all = state.problem->hypotheses();
  const Hypothesis& richer = all[trial.hypothesis];
  std::optional<double> least;
  const auto consider = [&](std::size_t plain, const ExtendedFit& fit) {
    if (is_special_case(all[plain], richer)) {
      least = std::min(least.value_or(state.compare.evidence_of_all(fit, state.result.after)),
                       state.compare.evidence_of_all(fit, state.result.after));
    }
  };
  consider(effect.law.hypothesis, state.result.after);
  for (const Trial* other : others) consider(other->hypothesis, other->fit);
  return least;
}

// Where the noise is not known: a law that few machines have, with more parameters than the plain
// one found, and which does not predict better by kRarerErrors standard errors. Much can stand in
// for a constant force or for viscous friction; that is no reason to doubt these.
bool is_rarer(const SearchState& state, const Trial& trial, const FoundEffect& effect) {
  if (state.problem->noise_is_known()) return false;
  const bool is_rare = state.hypothesis(trial.hypothesis).rank >= kRareRank &&
                       state.hypothesis(effect.law.hypothesis).rank < kRareRank;
  const bool is_richer = trial.fit.laws.back().parameters.size() > effect.law.parameters.size();
  return is_rare && is_richer &&
         state.compare.disadvantage(trial.fit, state.result.after) > -kRarerErrors * kRarerErrors;
}

// Where the noise is not known, what is left is no white noise: how far blocks kept out tell the
// two apart says how much the recordings at hand are worth.
double told_now(const SearchState& state, const ExtendedFit& rival) {
  constexpr double kLeast = 1.0;  // less is chance
  if (state.problem->noise_is_known()) return std::numeric_limits<double>::infinity();
  return std::max(kLeast, state.compare.disadvantage(rival, state.result.after));
}

std::optional<NextExperiment> experiment_against(SearchState& state, const ExtendedFit& rival) {
  if (!state.proceed("designing the experiment that excludes " +
                     state.name_of(rival.laws.back().hypothesis))) {
    return {};
  }
  const auto experiments = state.problem->experiments_between(state.result.after, rival);
  if (!experiments || !(experiments->distance_at_best > 0.0)) return {};
  try {
    return next_experiment(*experiments, state.options.exclusion_margin, told_now(state, rival));
  } catch (const InputError&) {
    // No experiment of this kind sees all parameters of the rival, which is no reason to end here.
    return {};
  }
}

}  // namespace

void divide_rivals(SearchState& state, FoundEffect& effect, const std::vector<Trial>& trials) {
  std::vector<const Trial*> standing;
  for (const Trial& trial : trials) {
    if (!state.compare.excludes(state.result.after, trial.fit)) standing.push_back(&trial);
  }
  // Fits of the class, the law found first. Laws of which no other that stands is a special case
  // come before the others.
  std::vector<const ExtendedFit*> members{&state.result.after};
  for (const bool richer : {false, true}) {
    for (const Trial& trial : trials) {
      const std::optional<double> least = evidence_of_special_cases(state, trial, effect, standing);
      const bool stands = std::ranges::find(standing, &trial) != standing.end();
      const bool rarer = !least && stands && is_rarer(state, trial, effect);
      if ((least.has_value() || rarer) != richer) continue;
      Rival rival{
          .law = trial.fit.laws.back(),
          .bic_difference = state.compare.disadvantage(trial.fit, state.result.after),
          .evidence_difference = evidence(trial.fit) - evidence(state.result.after),
          .held_out_difference = state.compare.held_out_difference(trial.fit, state.result.after)};
      rival.is_contradicted = state.problem->noise_is_known() &&
                              state.compare.contradicts(trial.fit, state.result.after);
      const bool is_rival = richer ? state.problem->noise_is_known() && !rival.is_contradicted &&
                                         state.compare.evidence_of_all(
                                             trial.fit, state.result.after) < *least - kAskedFor
                                   : stands;
      if (is_rival) {
        if (std::vector<FittedLaw>* same = same_law_among(state, members, trial.fit, effect)) {
          same->push_back(std::move(rival.law));
          continue;
        }
        members.push_back(&trial.fit);
        state.class_fits.push_back(trial.fit);
        effect.rivals.push_back(std::move(rival));
      } else if (!richer || rival.is_contradicted ||
                 (!stands && !state.problem->noise_is_known())) {
        effect.excluded.push_back(std::move(rival));
      } else if (!state.problem->noise_is_known() ||
                 state.compare.evidence_of_all(trial.fit, state.result.after) <=
                     *least + state.options.exclusion_margin) {
        state.class_fits.push_back(trial.fit);
        effect.generalisations.push_back(std::move(rival));
      }
    }
  }
  if (!effect.rivals.empty()) effect.rivals.front().next = experiment_against(state, *members[1]);
}

void add_twins(const SearchState& state, FoundEffect& effect) {
  const std::span<const Hypothesis> all = state.problem->hypotheses();
  std::vector<Rival> members{{.law = effect.law}};
  members.insert(members.end(), effect.rivals.begin(), effect.rivals.end());
  std::vector<Rival> generalisations;  // in the order of the members
  for (const Rival& member : members) {
    for (const std::size_t twin : all[member.law.hypothesis].twins) {
      if (is_excluded(state, all[twin])) continue;
      Rival rival{.law = {twin, {}},
                  .bic_difference = member.bic_difference,
                  .evidence_difference = member.evidence_difference,
                  .held_out_difference = member.held_out_difference};
      if (is_special_case(all[member.law.hypothesis], all[twin])) {
        generalisations.push_back(std::move(rival));
      } else {
        effect.rivals.push_back(std::move(rival));
      }
    }
  }
  effect.generalisations.insert(effect.generalisations.begin(), generalisations.begin(),
                                generalisations.end());
}

void keep_best_generalisations(FoundEffect& effect) {
  std::size_t names = 1 + effect.same_at.size();
  for (const Rival& rival : effect.rivals) names += 1 + rival.same_at.size();
  const std::size_t room = kNames - std::min(kNames, names);
  if (effect.generalisations.size() > room) effect.generalisations.resize(room);
}

}  // namespace graybox
