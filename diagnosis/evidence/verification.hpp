// Step 6 of the search (diagnosis_search.hpp): is what the laws leave no more than noise?
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// On recordings kept out, or on the fit's own where there are none; with what the report shows of
// the rest.
void verify_rest(SearchState& state);

// Where the noise is known: the tests of practical size.
[[nodiscard]] bool rest_passes(SearchState& state);

}  // namespace graybox
