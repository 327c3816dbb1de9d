#include "diagnosis/search/candidate_ranking.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <span>

#include "diagnosis/hypotheses/law_shapes.hpp"

namespace graybox {
namespace {

// Share of the best score statistic that makes a law worth a refit: at the same place, and
// anywhere.
constexpr double kRelative = 0.7;
constexpr double kEqual = 0.97;
// How close a law must come that may take another's place: its refit may gain what the score does
// not see.
constexpr double kComparable = 0.5;

// Candidates for a small law; and how much more a refit may gain than the score test at the best
// shape promises.
constexpr std::size_t kSmallShortlist = 3;
constexpr double kOptimism = 3.0;

// Laws that generalise the one found, beside those that the ranking brings.
constexpr int kMoreGeneral = 2;

bool is_closed(const SearchState& state, const Hypothesis& hypothesis) {
  return hypothesis.rank > state.highest_rank ||
         (hypothesis.is_compound && !state.compounds_are_open);
}

// Whether a wave has another length than the one that was rejected.
bool is_another_wave(const FittedLaw& rejected, const LawStart& start) {
  constexpr double kAlike = 1.05;
  for (std::size_t i = 0; i < std::min(rejected.parameters.size(), start.parameters.size()); ++i) {
    if (rejected.parameters[i].name != "period") continue;
    const double ratio = start.parameters[i] / rejected.parameters[i].value;
    return ratio > kAlike || ratio < 1.0 / kAlike;
  }
  return false;
}

// Recordings kept out have spoken against it (law_rejection.hpp).
bool is_rejected(const SearchState& state, const LawStart& start) {
  return std::ranges::any_of(state.result.rejected, [&](const RejectedLaw& rejected) {
    return rejected.law.hypothesis == start.hypothesis && !is_another_wave(rejected.law, start);
  });
}

}  // namespace

bool is_excluded(const SearchState& state, const Hypothesis& hypothesis) {
  const auto& laws = state.options.excluded_laws;
  return std::find(laws.begin(), laws.end(), hypothesis.law) != laws.end();
}

bool is_special_case(const Hypothesis& plain, const Hypothesis& richer) {
  return richer.place == plain.place &&
         std::count(richer.special_cases.begin(), richer.special_cases.end(), plain.law) > 0;
}

bool may_stand_in(const Hypothesis& rival, const Hypothesis& found) {
  if (rival.acts_on.empty() || found.acts_on.empty()) return true;
  return std::ranges::any_of(rival.acts_on, [&](std::size_t coordinate) {
    return std::ranges::count(found.acts_on, coordinate) > 0;
  });
}

namespace {

// Where the noise is not known: a friction that is at the place already in another shape. It may
// only take that one's place.
bool is_second_friction(const SearchState& state, const Hypothesis& hypothesis,
                        const ExtendedFit& fit) {
  if (state.problem->noise_is_known()) return false;
  return std::ranges::any_of(fit.laws, [&](const FittedLaw& law) {
    const Hypothesis& present = state.hypothesis(law.hypothesis);
    return present.place == hypothesis.place && are_one_friction(present.law, hypothesis.law);
  });
}

}  // namespace

std::vector<std::size_t> open_hypotheses(const SearchState& state, const ExtendedFit& fit) {
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < state.problem->hypotheses().size(); ++i) {
    const auto present = [i](const FittedLaw& law) { return law.hypothesis == i; };
    const Hypothesis& hypothesis = state.hypothesis(i);
    if (hypothesis.only_named || is_excluded(state, hypothesis) || is_closed(state, hypothesis) ||
        is_second_friction(state, hypothesis, fit)) {
      continue;
    }
    if (hypothesis.repeatable || std::none_of(fit.laws.begin(), fit.laws.end(), present)) {
      open.push_back(i);
    }
  }
  return open;
}

ScoreTable rank_hypotheses(const SearchState& state, const ExtendedFit& fit, int draws,
                           const std::function<bool(const Hypothesis&)>& considered) {
  std::vector<std::size_t> open = open_hypotheses(state, fit);
  if (considered) {
    std::erase_if(open, [&](std::size_t i) { return !considered(state.hypothesis(i)); });
  }
  if (open.empty()) return {};
  ScoreTable table = state.problem->scores(fit, open, draws, state.options.seed);
  const double cost = std::log(state.problem->sample_count());
  const auto gain = [cost](const HypothesisScore& score) {
    return score.score.statistic - cost * score.score.degrees_of_freedom;
  };
  std::stable_sort(
      table.scores.begin(), table.scores.end(),
      [&](const HypothesisScore& a, const HypothesisScore& b) { return gain(a) > gain(b); });
  return table;
}

std::vector<LawStart> shortlist(const SearchState& state, const ScoreTable& table) {
  std::vector<LawStart> chosen;
  std::set<std::string> places;
  const HypothesisScore* best = nullptr;
  const std::size_t crowd = std::max<std::size_t>(1, state.options.shortlist / 2);
  std::size_t relatives = 0;
  for (const HypothesisScore& score : table.scores) {
    if (!can_be_refitted(state, score)) continue;
    if (best == nullptr) best = &score;
    const std::string& place = state.place_of(score.start.hypothesis);
    const bool has_room = chosen.size() < state.options.shortlist + relatives;
    if (has_room && (chosen.size() < crowd || places.count(place) == 0)) {
      chosen.push_back(score.start);
      places.insert(place);
    } else if (state.problem->noise_is_known() && relatives < crowd &&
               score.score.statistic >
                   (place == state.place_of(best->start.hypothesis) ? kRelative : kEqual) *
                       best->score.statistic) {
      chosen.push_back(score.start);
      ++relatives;
    }
  }
  return chosen;
}

std::vector<LawStart> comparable(std::vector<LawStart> starts, const ScoreTable& table,
                                 std::size_t found) {
  const auto score_of = [&table](std::size_t hypothesis) {
    return std::ranges::find(table.scores, hypothesis,
                             [](const HypothesisScore& score) { return score.start.hypothesis; });
  };
  const auto own = score_of(found);
  if (own == table.scores.end()) return starts;
  std::erase_if(starts, [&](const LawStart& start) {
    const auto score = score_of(start.hypothesis);
    return score != table.scores.end() &&
           score->score.statistic < kComparable * own->score.statistic;
  });
  return starts;
}

std::vector<LawStart> small_shortlist(const SearchState& state, const ScoreTable& table,
                                      double to_stand_out) {
  const double enough =
      std::max(kRelative * table.scores.front().score.statistic, to_stand_out / kOptimism);
  std::vector<LawStart> chosen;
  for (const HypothesisScore& score : table.scores) {
    if (chosen.size() == kSmallShortlist) break;
    if (can_be_refitted(state, score) && score.score.statistic >= enough) {
      chosen.push_back(score.start);
    }
  }
  return chosen;
}

bool fill_up_shortlist(const SearchState& state, const ScoreTable& table,
                       std::vector<LawStart>& chosen) {
  const std::size_t before = chosen.size();
  for (const HypothesisScore& score : table.scores) {
    if (chosen.size() >= state.options.shortlist) break;
    if (!can_be_refitted(state, score)) continue;
    if (std::ranges::find(chosen, score.start) == chosen.end()) chosen.push_back(score.start);
  }
  return chosen.size() > before;
}

void add_more_general(const SearchState& state, std::size_t found, const ScoreTable& table,
                      std::vector<LawStart>& candidates) {
  const std::span<const Hypothesis> all = state.problem->hypotheses();
  const auto& plainer = all[found].special_cases;
  const auto slow_limits = std::ranges::count(plainer, "viscous");
  if (!state.problem->noise_is_known() || std::ssize(plainer) == slow_limits) return;
  int room = kMoreGeneral;
  for (const HypothesisScore& score : table.scores) {
    const std::size_t hypothesis = score.start.hypothesis;
    if (room == 0) return;
    if (!can_be_refitted(state, score) || !is_special_case(all[found], all[hypothesis])) continue;
    if (std::ranges::find(candidates, hypothesis, &LawStart::hypothesis) != candidates.end()) {
      continue;
    }
    candidates.push_back(score.start);
    --room;
  }
}

bool can_be_refitted(const SearchState& state, const HypothesisScore& score) {
  return score.score.degrees_of_freedom > 0.0 && !score.start.parameters.empty() &&
         !is_closed(state, state.hypothesis(score.start.hypothesis)) &&
         !is_rejected(state, score.start);
}

}  // namespace graybox
