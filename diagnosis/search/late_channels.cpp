#include "diagnosis/search/late_channels.hpp"

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/search/candidate_ranking.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

constexpr double kPays = 0.9;  // of the squared error, at most, of the channels that were moved
constexpr int kMoves = 2;      // the first is told beside laws that stand in for part of it

// Mean square of what each of these channels leaves of its own signal on recordings kept out: a
// channel of small forces counts as much as the others.
double error_kept_out(const MismatchProblem& problem, const ExtendedFit& fit,
                      const std::vector<MovedChannel>& channels) {
  double squares = 0.0;
  for (const ChannelRest& rest : problem.channel_rests(fit)) {
    if (std::ranges::find(channels, rest.channel, &MovedChannel::channel) == channels.end())
      continue;
    const double error = rest.held_out_nrmse.value_or(0.0);
    squares += error * error;
  }
  return squares;
}

std::optional<double> error_kept_out(const MismatchProblem& problem, const ExtendedFit& fit,
                                     const std::string& channel) {
  const std::vector<ChannelRest> rests = problem.channel_rests(fit);
  const auto rest = std::ranges::find(rests, channel, &ChannelRest::channel);
  return rest == rests.end() ? std::nullopt : rest->held_out_nrmse;
}

void note_late_channels(SearchState& state, const MismatchProblem& as_recorded,
                        const ExtendedFit& found_before) {
  state.result.late_channels.clear();
  for (const MovedChannel& moved : state.problem->moved_channels()) {
    const auto before = error_kept_out(as_recorded, found_before, moved.channel);
    const auto after = error_kept_out(*state.problem, state.result.after, moved.channel);
    if (before && after) state.result.late_channels.push_back({moved, *before, *after});
  }
}

// The laws sought anew; false where that is no better, and all is as it was.
bool find_better_in_time(SearchState& state, std::unique_ptr<MismatchProblem> moved,
                         const std::function<void(SearchState&)>& find_laws) {
  ExtendedFit without_laws = moved->fit({}, nullptr);
  if (!without_laws.usable) return false;
  Diagnosis& result = state.result;
  const MismatchProblem& before = *state.problem;
  const std::vector<MovedChannel> channels = moved->moved_channels();
  const double error = error_kept_out(before, result.after, channels);
  const ExtendedFit after = result.after;
  const std::vector<FoundEffect> effects = result.effects;
  const std::vector<RejectedLaw> rejected = result.rejected;
  const std::optional<ExtendedFit> freed = state.freed_without_laws;
  state.go_on_with(std::move(moved));
  state.freed_without_laws = without_laws;
  result.after = std::move(without_laws);
  result.effects.clear();
  result.rejected.clear();
  const auto go_back = [&] {
    state.go_back_to(before);
    state.freed_without_laws = freed;
    result.after = after;
    result.effects = effects;
    result.rejected = rejected;
  };
  try {
    find_laws(state);
  } catch (const Stopped&) {  // half a search is no answer: the one before stands
    go_back();
    throw;
  }
  if (error_kept_out(*state.problem, result.after, channels) < kPays * error) return true;
  go_back();
  return false;
}

bool is_rare(const SearchState& state, const FittedLaw& law) {
  return state.hypothesis(law.hypothesis).rank >= kRareRank;
}

// The plain friction of the places that have a rare law, in place of these: a law with memory has
// much of the shape of lateness. None where no law is rare.
std::optional<ExtendedFit> with_plain_friction(SearchState& state) {
  const ExtendedFit& found = state.result.after;
  std::vector<LawStart> laws;
  std::set<std::string> places;
  for (std::size_t law = 0; law < found.laws.size(); ++law) {
    const FittedLaw& each = found.laws[law];
    if (is_rare(state, each)) {
      places.insert(state.place_of(each.hypothesis));
    } else {
      laws.push_back({each.hypothesis, each.values()});
    }
  }
  if (places.empty()) return {};
  ExtendedFit fit = laws.empty() ? state.without_laws() : state.refits.refit(laws, found);
  if (!fit.usable) return {};
  const ScoreTable table = rank_hypotheses(state, fit, 0, [&](const Hypothesis& hypothesis) {
    return hypothesis.rank <= kExpectedRank && places.contains(hypothesis.place);
  });
  for (const HypothesisScore& score : table.scores) {
    if (!can_be_refitted(state, score)) continue;
    std::vector<LawStart> more = starts_of(fit);
    more.push_back(score.start);
    ExtendedFit richer = state.refits.refit(more, fit);
    if (richer.usable) fit = std::move(richer);
  }
  return fit;
}

std::unique_ptr<MismatchProblem> in_time(SearchState& state) {
  std::unique_ptr<MismatchProblem> moved = state.problem->in_time(state.result.after);
  if (moved) return moved;
  const std::optional<ExtendedFit> plain = with_plain_friction(state);
  return plain ? state.problem->in_time(*plain) : nullptr;
}

}  // namespace

void find_laws_in_time(SearchState& state, const std::function<void(SearchState&)>& find_laws) {
  const MismatchProblem& as_recorded = *state.problem;
  const ExtendedFit found_before = state.result.after;
  for (int move = 0; move < kMoves; ++move) {
    if (state.problem->noise_is_known() || !state.proceed("looking for forces that come late")) {
      return;
    }
    std::unique_ptr<MismatchProblem> moved = in_time(state);
    if (!moved || !find_better_in_time(state, std::move(moved), find_laws)) return;
    note_late_channels(state, as_recorded, found_before);
  }
}

}  // namespace graybox
