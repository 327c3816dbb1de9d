// Step 2 of the search (diagnosis_search.hpp): is anything missing, and what would have been seen?
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// At family-wise level; with the least of each effect that would have been seen, and the ranking of
// all hypotheses.
void detect_mismatch(SearchState& state);

}  // namespace graybox
