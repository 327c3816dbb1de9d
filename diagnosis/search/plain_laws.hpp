// Step 3 of the search (diagnosis_search.hpp) where a robot's joints share bodies and loads and the
// noise is not known: all plain laws at once, before single ones come.
//
// One by one, what is still missing at one joint hides what is missing at the others. A joint whose
// friction is missing bends the load that all carry, and under the wrong load its friction does not
// show. So all friction comes first, then loads, then offsets (Hypothesis::rank), each joint beside
// all others; what can't be (a friction that drives) goes. Then laws go that are not missed by the
// tests that bring a single law, the least first: backward elimination (Draper and Smith 1998,
// Chapter 15). What remains must predict better than the model without any.
//
// Cost: a few fits with all plain laws, and n + (n - 1) + ... with one less each.
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// Does nothing where laws were found, the noise is known, or one coordinate is all there is.
void begin_with_plain_laws(SearchState& state);

// The same for one coordinate, with springs, where single laws came to nothing. Dry friction alone
// may lower the error by too little where a spring is missing, too.
void end_with_plain_laws(SearchState& state);

}  // namespace graybox
