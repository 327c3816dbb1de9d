#include "diagnosis/search/renewal.hpp"

#include <algorithm>
#include <memory>
#include <set>
#include <utility>

#include "diagnosis/search/mismatch_detection.hpp"

namespace graybox {
namespace {

// Rivals of a single law that leave more than the noise's own chi-square beside it: free motion is
// not that much.
void keep_far_behind(SearchState& state) {
  if (state.result.after.laws.size() != 1) return;
  state.ahead = state.result.after.laws.front().hypothesis;
  for (const Refit& known : state.refits.known()) {
    const ExtendedFit& fit = known.fit;
    if (!fit.usable || fit.laws.size() != 1 || fit.laws.front().hypothesis == state.ahead) continue;
    state.far_behind.push_back(
        {.law = fit.laws.front(),
         .bic_difference = state.compare.bic(fit) - state.compare.bic(state.result.after),
         .evidence_difference = evidence(fit) - evidence(state.result.after),
         .on_other_noise = true});
  }
  // The best fit with each counts.
  std::ranges::stable_sort(state.far_behind, {}, &Rival::bic_difference);
  std::set<std::size_t> seen;
  std::erase_if(state.far_behind, [&](const Rival& rival) {
    return !seen.insert(rival.law.hypothesis).second ||
           rival.bic_difference <= state.result.after.estimation.degrees_of_freedom;
  });
}

}  // namespace

void renew_without_laws(SearchState& state) {
  std::unique_ptr<MismatchProblem> problem = state.problem->renewed(state.result.before);
  if (problem == nullptr) return;
  ExtendedFit fit = problem->fit({}, nullptr);
  if (!fit.usable) return;
  state.go_on_with(std::move(problem));
  state.result.before = std::move(fit);
}

bool renew_with_laws(SearchState& state) {
  if (state.tried_to_renew || !state.problem->noise_is_known()) return false;
  if (!state.proceed("taking free motion out with what was found")) return false;
  std::unique_ptr<MismatchProblem> problem = state.problem->renewed(state.result.after);
  if (problem == nullptr) return false;
  state.tried_to_renew = true;
  ExtendedFit before = problem->fit({}, &state.result.before);
  ExtendedFit after = problem->fit(starts_of(state.result.after), &state.result.after);
  if (!after.usable && !after.laws.empty()) after = problem->fit(starts_of(after), &after);
  if (!before.usable || !after.usable ||
      after.estimation.chi_square_per_dof() >= state.result.after.estimation.chi_square_per_dof()) {
    return false;
  }
  keep_far_behind(state);
  state.go_on_with(std::move(problem));
  state.result.before = std::move(before);
  state.describe_fit_as_it_is();
  detect_mismatch(state);
  state.result.detection.detected = true;  // it was, and of that there is a law now
  state.result.after = std::move(after);
  return true;
}

bool was_far_behind(SearchState& state, std::size_t hypothesis, std::size_t found,
                    std::vector<Rival>& excluded) {
  if (found != state.ahead || hypothesis == found) return false;
  const auto behind = std::ranges::find(state.far_behind, hypothesis,
                                        [](const Rival& rival) { return rival.law.hypothesis; });
  if (behind == state.far_behind.end()) return false;
  excluded.push_back(*behind);
  return true;
}

}  // namespace graybox
