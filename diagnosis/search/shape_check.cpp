#include "diagnosis/search/shape_check.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "diagnosis/evidence/verification.hpp"
#include "diagnosis/search/candidate_ranking.hpp"
#include "diagnosis/search/law_selection.hpp"
#include "diagnosis/search/rival_weighing.hpp"

namespace graybox {
namespace {

// Times that laws which only resemble what is there are weighed again: with all laws at their
// places, and with another besides.
constexpr int kShapeRounds = 4;

void note_shared_characteristics(SearchState& state) {
  std::map<std::pair<std::string, Characteristic>, std::vector<std::size_t>> found;
  for (const FoundEffect& effect : state.result.effects) {
    const Hypothesis& law = state.hypothesis(effect.law.hypothesis);
    if (law.characteristic != Characteristic::kNone) {
      found[{law.place, law.characteristic}].push_back(effect.law.hypothesis);
    }
  }
  state.result.shared_characteristics.clear();
  for (auto& [which, laws] : found) {
    if (laws.size() < 2) continue;
    state.result.shared_characteristics.push_back({which.first, which.second, std::move(laws)});
  }
}

// At the places of its own laws and of those found.
ShapeComparison shapes_left_by(const SearchState& state, const ExtendedFit& fit) {
  std::set<std::string> places;
  for (const FittedLaw& law : fit.laws) places.insert(state.place_of(law.hypothesis));
  for (const FittedLaw& law : state.result.after.laws) {
    places.insert(state.place_of(law.hypothesis));
  }
  std::vector<std::size_t> there = open_hypotheses(state, fit);
  std::erase_if(there, [&](std::size_t other) { return places.count(state.place_of(other)) == 0; });
  return compare_shapes(*state.problem, fit, there,
                        {.level = state.options.verification_level,
                         .imperfection = kImperfection,
                         .explained = state.result.before.deviance - fit.deviance,
                         .seed = state.options.seed});
}

bool only_resemble(SearchState& state) {
  if (!state.proceed("comparing the shapes of what was found")) return false;
  note_shared_characteristics(state);
  ShapeComparison shapes = shapes_left_by(state, state.result.after);
  state.result.shapes_compared = shapes.could_tell;
  for (const ExtendedFit& other : state.class_fits) {
    if (shapes.departures.empty()) break;
    const ShapeComparison of_other = shapes_left_by(state, other);
    if (of_other.could_tell && of_other.departures.empty()) shapes.departures.clear();
  }
  state.result.departures = std::move(shapes.departures);
  return !state.result.departures.empty() || !state.result.shared_characteristics.empty();
}

// All that the catalogue has there is to be weighed now. Whether that is new.
bool open_departed_places(SearchState& state) {
  const std::size_t before = state.departed_places.size();
  for (const Departure& departure : state.result.departures) {
    state.departed_places.insert(state.place_of(departure.start.hypothesis));
  }
  for (const SharedCharacteristic& shared : state.result.shared_characteristics) {
    state.departed_places.insert(shared.place);
  }
  return state.departed_places.size() > before;
}

// With a law found at its place.
bool shares_a_characteristic(const SearchState& state, std::size_t hypothesis) {
  const std::span<const Hypothesis> all = state.problem->hypotheses();
  return all[hypothesis].characteristic != Characteristic::kNone &&
         std::ranges::any_of(state.result.after.laws, [&](const FittedLaw& law) {
           return all[law.hypothesis].place == all[hypothesis].place &&
                  all[law.hypothesis].characteristic == all[hypothesis].characteristic;
         });
}

// A law of another characteristic than the one that is there may be a second effect: if nothing
// departs from both.
bool add_departing_law(SearchState& state) {
  if (state.result.departures.empty() || state.result.after.laws.size() >= state.effect_limit()) {
    return false;
  }
  const LawStart& besides = state.result.departures.front().start;
  if (besides.parameters.empty() || shares_a_characteristic(state, besides.hypothesis)) {
    return false;
  }
  const std::vector<Trial> trials = state.refits.refit_to_all(
      each_beside(starts_of(state.result.after), {besides}), state.result.after);
  if (trials.empty() || !stands_out(state, trials.front().fit) ||
      !shapes_left_by(state, trials.front().fit).departures.empty()) {
    return false;
  }
  state.result.after = trials.front().fit;
  return true;
}

}  // namespace

void look_for_departures(SearchState& state) {
  if (!state.problem->noise_is_known()) return;
  for (int round = 0; round < kShapeRounds; ++round) {
    const bool may_be_all =
        state.result.verified || state.compare.rest_is_noise(state.result.after);
    if (!may_be_all || state.result.effects.empty() || !state.result.rivals_weighed) break;
    if (!only_resemble(state)) return;
    const bool is_last = round + 1 == kShapeRounds;
    if (is_last || (!open_departed_places(state) && !add_departing_law(state))) break;
    state.result.departures.clear();
    state.result.shared_characteristics.clear();
    weigh_rivals(state);
    verify_rest(state);
  }
  // No use to tell apart what both are wrong.
  if (state.result.departures.empty()) return;
  for (FoundEffect& effect : state.result.effects) {
    for (Rival& rival : effect.rivals) rival.next.reset();
  }
}

}  // namespace graybox
