// Step 3 of the search (diagnosis_search.hpp): laws for what is missing, one after another.
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// As many as are significant, beside those that are there.
void add_missing_laws(SearchState& state);

// A law more than those found so far, though what these leave is no more than noise.
[[nodiscard]] bool stands_out(const SearchState& state, const ExtendedFit& with);

}  // namespace graybox
