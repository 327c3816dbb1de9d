#include "diagnosis/search/plain_laws.hpp"

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "diagnosis/search/candidate_ranking.hpp"
#include "diagnosis/search/law_pruning.hpp"

namespace graybox {
namespace {

// Of one axis alone a spring is as plain as a weight, whose tangent it is.
bool is_plain(const Hypothesis& hypothesis, int highest_rank, bool with_springs = false) {
  const bool is_spring = with_springs && highest_rank == kRareRank - 1 &&
                         hypothesis.law == "stiffness" && !hypothesis.is_compound;
  return is_spring || (hypothesis.rank <= highest_rank && !hypothesis.is_compound);
}

bool has_several_coordinates(const SearchState& state) {
  const std::vector<std::size_t>* first = nullptr;
  for (const Hypothesis& hypothesis : state.problem->hypotheses()) {
    if (!is_plain(hypothesis, kRareRank - 1)) continue;
    if (first == nullptr) first = &hypothesis.acts_on;
    if (hypothesis.acts_on != *first) return true;
  }
  return false;
}

// Without those that turn out impossible beside the others.
ExtendedFit fit_what_is_possible(SearchState& state, std::vector<LawStart> laws,
                                 const ExtendedFit& nearby) {
  ExtendedFit fit = state.refits.refit(laws, nearby);
  while (!fit.usable && !fit.impossible.empty() && fit.impossible.size() < laws.size()) {
    for (auto law = fit.impossible.rbegin(); law != fit.impossible.rend(); ++law) {
      laws.erase(laws.begin() + static_cast<std::ptrdiff_t>(*law));
    }
    fit = state.refits.refit(laws, nearby);
  }
  return fit;
}

// All that the recordings let stand beside one another; friction that a missing load hid is asked
// for once more at the end.
ExtendedFit with_all_plain_laws(SearchState& state, bool with_springs) {
  ExtendedFit fit = state.result.after;
  for (int step = kExpectedRank; step <= kRareRank; ++step) {
    if (!state.proceed("fitting all plain laws at once")) return fit;
    const int rank = std::min(step, kRareRank - 1);
    const ScoreTable table = rank_hypotheses(state, fit, 0, [&](const Hypothesis& hypothesis) {
      return is_plain(hypothesis, rank, with_springs);
    });
    std::vector<LawStart> laws = starts_of(fit);
    for (const HypothesisScore& score : table.scores) {
      if (laws.size() == state.effect_limit()) break;
      if (can_be_refitted(state, score)) laws.push_back(score.start);
    }
    if (laws.size() == fit.laws.size()) continue;
    ExtendedFit more = fit_what_is_possible(state, std::move(laws), fit);
    if (more.usable) fit = std::move(more);
  }
  return fit;
}

// The fit without the law that is missed least; none where each is needed.
std::optional<ExtendedFit> without_the_least(SearchState& state, const ExtendedFit& fit) {
  std::optional<ExtendedFit> left;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t law = 0; law < fit.laws.size(); ++law) {
    ExtendedFit without = fit_without(state, fit, law);
    if (!without.usable || state.compare.is_borne_out(without, fit, law)) continue;
    const double gain = held_out_gain(without, fit).mean;
    if (gain >= least) continue;
    least = gain;
    left = std::move(without);
  }
  return left;
}

// Those that the recordings ask for, beside the laws of the last fit; none where they are not
// better than that.
std::optional<ExtendedFit> needed_plain_laws(SearchState& state, bool with_springs = false) {
  ExtendedFit fit = with_all_plain_laws(state, with_springs);
  while (!fit.laws.empty()) {
    if (!state.proceed("leaving out plain laws that are not missed")) return {};
    std::optional<ExtendedFit> left = without_the_least(state, fit);
    if (!left) break;
    fit = *std::move(left);
  }
  if (fit.laws.empty() ||
      !state.compare.predicts_better(state.without_laws(), fit, state.options.held_out_errors)) {
    return {};
  }
  return fit;
}

double error_of(const MismatchProblem& problem, const ExtendedFit& fit) {
  return problem.validate(fit).value_or(fit.estimation).nrmse;
}

// What the model states may be off by as much as it says, and forces at joints then only stand in
// for that: with it free, fewer or other laws are needed. It stays free unless the model as stated
// predicts blocks kept out better.
void free_what_is_uncertain(SearchState& state) {
  const MismatchProblem& stated = *state.problem;
  std::unique_ptr<MismatchProblem> freed = stated.with_uncertain_model(state.result.after);
  if (!freed || !state.proceed("freeing what the model states within its uncertainty")) return;
  const ExtendedFit with_stated = state.result.after;
  state.go_on_with(std::move(freed));
  state.freed_without_laws = state.problem->fit({}, nullptr);
  const ExtendedFit same_laws =
      state.problem->fit(starts_of(with_stated), &*state.freed_without_laws);
  state.result.after = same_laws.usable ? same_laws : *state.freed_without_laws;
  const ExtendedFit best = needed_plain_laws(state).value_or(*state.freed_without_laws);
  const double error_stated = error_of(stated, with_stated),
               error_freed = error_of(*state.problem, best);
  if (!best.usable || state.compare.predicts_better(best, with_stated, kExclusionErrors)) {
    state.go_back_to(stated);
    state.result.after = with_stated;
    return;
  }
  state.result.after = best;
  state.settle_shapes();
  state.result.freed_model =
      FreedModel{error_stated, error_freed, state.problem->validate(best).has_value(), {}, {}};
}

}  // namespace

void begin_with_plain_laws(SearchState& state) {
  if (state.problem->noise_is_known() || !state.result.after.laws.empty() ||
      !has_several_coordinates(state)) {
    return;
  }
  if (std::optional<ExtendedFit> fit = needed_plain_laws(state)) {
    state.result.after = *std::move(fit);
    state.settle_shapes();
  }
  if (!state.freed_without_laws) free_what_is_uncertain(state);
}

void end_with_plain_laws(SearchState& state) {
  if (state.problem->noise_is_known() || !state.result.after.laws.empty() ||
      has_several_coordinates(state)) {
    return;
  }
  std::optional<ExtendedFit> fit = needed_plain_laws(state, true);
  if (!fit) return;
  state.result.after = *std::move(fit);
  state.settle_shapes();
}

}  // namespace graybox
