#include "diagnosis/evidence/candidate_refits.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace graybox {
namespace {

// On few recordings, of BIC over the margin that excludes, and of what the best there leaves beyond
// noise: who is farther behind is not fitted to all.
constexpr double kMarginsBehind = 3.0;
constexpr double kShareBehind = 0.3;

}  // namespace

std::vector<std::vector<LawStart>> each_beside(const std::vector<LawStart>& kept,
                                               const std::vector<LawStart>& candidates) {
  std::vector<std::vector<LawStart>> asked(candidates.size(), kept);
  for (std::size_t i = 0; i < candidates.size(); ++i) asked[i].push_back(candidates[i]);
  return asked;
}

std::string name_of(const Hypothesis& hypothesis) {
  return hypothesis.law + " at " + hypothesis.place;
}

void CandidateRefits::start_anew(const MismatchProblem& problem) {
  problem_ = &problem;
  forget();
}

void CandidateRefits::forget() {
  known_.clear();
  known_of_few_.clear();
}

bool CandidateRefits::proceed_to(const std::string& what, const LawStart& law,
                                 const std::string& how) const {
  return proceed_(what + name_of(problem_->hypotheses()[law.hypothesis]) + how);
}

const ExtendedFit& CandidateRefits::refit(const std::vector<LawStart>& laws,
                                          const ExtendedFit& nearby) {
  const auto known = std::ranges::find(known_, laws, &Refit::laws);
  if (known != known_.end()) return known->fit;
  return known_.emplace_back(Refit{laws, problem_->fit(laws, &nearby)}).fit;
}

void CandidateRefits::refit_all(const std::vector<std::vector<LawStart>>& asked,
                                const ExtendedFit& nearby) {
  std::vector<std::vector<LawStart>> unknown;
  for (const std::vector<LawStart>& laws : asked) {
    if (std::ranges::find(known_, laws, &Refit::laws) == known_.end()) unknown.push_back(laws);
  }
  std::vector<ExtendedFit> fits = problem_->fit_each(unknown, &nearby);
  for (std::size_t i = 0; i < unknown.size(); ++i) {
    known_.push_back({std::move(unknown[i]), std::move(fits[i])});
  }
}

std::vector<Trial> CandidateRefits::refit_each(const std::vector<LawStart>& kept,
                                               const std::vector<LawStart>& candidates,
                                               const ExtendedFit& nearby, const LawStart* pace,
                                               std::vector<Rival>* outpaced) {
  const std::vector<std::vector<LawStart>> asked = each_beside(kept, candidates);
  std::optional<Race> race = race_on_few(asked, nearby, pace);
  if (!race) return refit_to_all(asked, nearby);
  std::vector<Trial> trials;
  for (const Refit& runner : race->standing) {
    if (!proceed_to("refitting with ", runner.laws.back(), " to all recordings")) break;
    std::vector<LawStart> laws = starts_of(runner.fit);
    laws.back().spares = runner.laws.back().spares;
    trials.push_back({laws.back().hypothesis, refit(laws, runner.fit)});
  }
  if (outpaced != nullptr) *outpaced = std::move(race->outpaced);
  keep_usable_in_order(trials, nearby);
  return trials;
}

void CandidateRefits::keep_usable_in_order(std::vector<Trial>& trials,
                                           const ExtendedFit& nearby) const {
  std::erase_if(trials, [](const Trial& trial) { return !trial.fit.usable; });
  std::ranges::stable_sort(
      trials, {}, [&](const Trial& trial) { return compare().criterion(trial.fit, nearby); });
}

std::vector<Trial> CandidateRefits::refit_to_all(std::vector<std::vector<LawStart>> asked,
                                                 const ExtendedFit& nearby) {
  std::size_t begun = 0;
  for (; begun < asked.size(); ++begun) {
    if (!proceed_to("refitting with ", asked[begun].back())) break;
    if (!problem_->fits_at_once()) (void)refit(asked[begun], nearby);
  }
  asked.resize(begun);
  refit_all(asked, nearby);
  std::vector<Trial> trials;
  for (const std::vector<LawStart>& laws : asked) {
    trials.push_back({laws.back().hypothesis, refit(laws, nearby)});
  }
  keep_usable_in_order(trials, nearby);
  return trials;
}

// None where all recordings are few, or too few fits to them came to an end.
std::optional<CandidateRefits::Race> CandidateRefits::race_on_few(
    std::vector<std::vector<LawStart>> asked, const ExtendedFit& nearby, const LawStart* pace) {
  if (asked.empty() || !problem_->has_few() || !problem_->noise_is_known()) return {};
  const std::vector<std::vector<LawStart>> runners = asked;
  if (pace != nullptr) {
    asked.push_back(asked.front());
    asked.back().back() = *pace;
  }
  std::vector<ExtendedFit> fits;
  for (const std::vector<LawStart>& laws : asked) {
    if (!proceed_to("refitting with ", laws.back())) return Race{};
    std::optional<ExtendedFit> fit = fit_to_few(laws, nearby);
    if (!fit) return {};
    fits.push_back(*std::move(fit));
  }
  const auto best = std::ranges::min_element(fits, {}, [this](const ExtendedFit& fit) {
    return fit.usable ? compare().bic(fit) : std::numeric_limits<double>::infinity();
  });
  if (!best->usable) return {};
  return divide(runners, fits, *best);
}

CandidateRefits::Race CandidateRefits::divide(const std::vector<std::vector<LawStart>>& runners,
                                              const std::vector<ExtendedFit>& fits,
                                              const ExtendedFit& best) const {
  const double limit =
      kMarginsBehind * options_->exclusion_margin + kShareBehind * std::max(0.0, excess(best));
  Race race;
  for (std::size_t i = 0; i < runners.size(); ++i) {
    if (fits[i].laws.empty()) continue;  // could not begin
    const double behind = compare().bic(fits[i]) - compare().bic(best);
    if (behind <= limit) {
      race.standing.push_back({runners[i], fits[i]});  // also one that did not settle yet
    } else if (fits[i].usable) {
      race.outpaced.push_back({.law = fits[i].laws.back(),
                               .bic_difference = behind,
                               .evidence_difference = evidence(fits[i]) - evidence(best),
                               .on_few_recordings = true});
    }
  }
  std::ranges::stable_sort(race.outpaced, {}, &Rival::bic_difference);
  return race;
}

std::optional<ExtendedFit> CandidateRefits::fit_to_few(const std::vector<LawStart>& laws,
                                                       const ExtendedFit& nearby) {
  const auto known = std::ranges::find(known_of_few_, laws, &Refit::laws);
  if (known != known_of_few_.end()) return known->fit;
  std::optional<ExtendedFit> fit = problem_->fit_to_few(laws, nearby);
  if (fit) known_of_few_.push_back({laws, *fit});
  return fit;
}

}  // namespace graybox
