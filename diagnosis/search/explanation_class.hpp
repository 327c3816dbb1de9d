// Step 5 of the search (diagnosis_search.hpp): the laws that recordings can't tell from the one
// found.
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// Trials with another law in the place of the one found: rivals that are not excluded,
// generalisations of those, and the others; and the experiment against the nearest.
void divide_rivals(SearchState& state, FoundEffect& effect, const std::vector<Trial>& trials);

// Hypotheses that such recordings tell from no member at any parameters (Hypothesis::twins).
void add_twins(const SearchState& state, FoundEffect& effect);

// As many as make three names with the law, its rivals and their places.
void keep_best_generalisations(FoundEffect& effect);

}  // namespace graybox
