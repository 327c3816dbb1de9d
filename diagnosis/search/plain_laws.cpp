#include "graybox/diagnosis/search/plain_laws.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "graybox/diagnosis/search/candidate_ranking.hpp"
#include "graybox/diagnosis/search/law_pruning.hpp"

namespace graybox {
namespace {

bool is_plain(const Hypothesis& hypothesis, int highest_rank) {
  return hypothesis.rank <= highest_rank && !hypothesis.is_compound;
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
ExtendedFit with_all_plain_laws(SearchState& state) {
  ExtendedFit fit = state.result.after;
  for (int step = kExpectedRank; step <= kRareRank; ++step) {
    if (!state.proceed("fitting all plain laws at once")) return fit;
    const int rank = std::min(step, kRareRank - 1);
    const ScoreTable table = rank_hypotheses(
        state, fit, 0, [rank](const Hypothesis& hypothesis) { return is_plain(hypothesis, rank); });
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

}  // namespace

void begin_with_plain_laws(SearchState& state) {
  if (state.problem->noise_is_known() || !state.result.after.laws.empty() ||
      !has_several_coordinates(state)) {
    return;
  }
  ExtendedFit fit = with_all_plain_laws(state);
  while (!fit.laws.empty()) {
    if (!state.proceed("leaving out plain laws that are not missed")) return;
    std::optional<ExtendedFit> left = without_the_least(state, fit);
    if (!left) break;
    fit = *std::move(left);
  }
  if (fit.laws.empty() ||
      !state.compare.predicts_better(state.result.after, fit, state.options.held_out_errors)) {
    return;
  }
  state.result.after = std::move(fit);
  state.settle_shapes();
}

}  // namespace graybox
