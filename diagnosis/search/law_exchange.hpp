// Step 4 of the search (diagnosis_search.hpp), where the noise is not known: other laws for those
// found early.
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// Laws found early stood in for several; once the others are there, another may fit better in
// their place. Until none does; then further laws may be missing again.
void exchange_laws(SearchState& state);

}  // namespace graybox
