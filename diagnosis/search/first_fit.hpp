// Steps 1 and 2 of the search (diagnosis_search.hpp): the model as it is, and again from where laws
// have led.
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// False: it can't be, and result.trouble says why, or it was stopped.
[[nodiscard]] bool fit_as_it_is(SearchState& state);

// What looks like missing physics may be a fit that stopped short of its optimum. With a law more
// the parameters have come elsewhere: from there the model alone is fitted once more. Whether it
// came to a better fit.
[[nodiscard]] bool fit_better(SearchState& state);

}  // namespace graybox
