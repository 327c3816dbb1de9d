// Steps 3 and 5 of the search (diagnosis_search.hpp): which hypotheses are worth a refit, by their
// score tests.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// Whether `richer` is `plain` for some of its parameters, at the same place.
[[nodiscard]] bool is_special_case(const Hypothesis& plain, const Hypothesis& richer);

// Whether both act on a coordinate that is measured by itself, or on all.
[[nodiscard]] bool may_stand_in(const Hypothesis& rival, const Hypothesis& found);

// Taken out of the catalogue.
[[nodiscard]] bool is_excluded(const SearchState& state, const Hypothesis& hypothesis);

// All hypotheses but those that are excluded, closed, only named or, unless repeatable, in the fit
// already.
[[nodiscard]] std::vector<std::size_t> open_hypotheses(const SearchState& state,
                                                       const ExtendedFit& fit);

// By what their score tests gain over what their parameters cost, best first. `draws` of pure
// noise: see ScoreTable. `considered`: only these; empty: all.
[[nodiscard]] ScoreTable rank_hypotheses(
    const SearchState& state, const ExtendedFit& fit, int draws,
    const std::function<bool(const Hypothesis&)>& considered = {});

// The best of the ranking, and besides the best law of each of the best places: laws at one place
// crowd each other's neighbours out. Where the noise is known, laws besides that come close to the
// best at its place, or as good as equal it anywhere: which of them it is only refits can tell.
[[nodiscard]] std::vector<LawStart> shortlist(const SearchState& state, const ScoreTable& table);

// Keeps the starts whose score comes close to that of the law found, by the table of a fit without
// it. All, where the table does not have that.
[[nodiscard]] std::vector<LawStart> comparable(std::vector<LawStart> starts,
                                               const ScoreTable& table, std::size_t found);

// Laws for what is still missing where the rest is no more than noise. Score tests are exact for
// small effects: only those that come close to the best are in question, if any of them may stand
// out: `to_stand_out`, of BIC. The table is not empty.
[[nodiscard]] std::vector<LawStart> small_shortlist(const SearchState& state,
                                                    const ScoreTable& table, double to_stand_out);

// Where there are fewer places than room, with the next best at any: laws that are nearly alike
// must not keep all others of a single axis out. Whether there were any.
bool fill_up_shortlist(const SearchState& state, const ScoreTable& table,
                       std::vector<LawStart>& chosen);

// Where the law found generalises another, and not only its own slow limit: laws that generalise
// it, if the ranking has not brought them. It ranks what a first step explains, in which they may
// have nothing over it.
void add_more_general(const SearchState& state, std::size_t found, const ScoreTable& table,
                      std::vector<LawStart>& candidates);

// Seen by these recordings, with an amplitude of a possible sign, and its place open.
[[nodiscard]] bool can_be_refitted(const SearchState& state, const HypothesisScore& score);

}  // namespace graybox
