// Step 5 of the search (diagnosis_search.hpp): each law found against those that may stand in its
// stead.
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// One of several laws found one after another may have a better rival now that the others are
// there. The rival then takes its place, and all are weighed again.
void weigh_rivals(SearchState& state);

}  // namespace graybox
