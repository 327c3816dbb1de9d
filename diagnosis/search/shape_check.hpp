// Step 6 of the search (diagnosis_search.hpp): is it these laws, or others like them?
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// Laws that only resemble what is there may leave no more than noise by the chi-square of all
// residuals.
void look_for_departures(SearchState& state);

}  // namespace graybox
