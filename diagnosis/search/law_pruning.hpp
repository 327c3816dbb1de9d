// Step 4 of the search (diagnosis_search.hpp): laws that are not missed go, and richer ones give
// way to plainer ones.
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// The fit without a law starts from the parameters that the fit has with it. Where the noise is
// known, a second one starts anew from those without any law and from the laws as they were ranked
// first. A law that stood in for another may have pulled all of them far off. Where the noise is
// known, it also starts anew from those without any law and from the laws as they were ranked
// first: a law that stood in for another may have pulled all of them far off. Where that is worse
// than without any law, from the first fit's own starts, too. Cost: up to three fits, the last as
// dear as the first fit of all.
[[nodiscard]] ExtendedFit fit_without(SearchState& state, const ExtendedFit& fit, std::size_t law);

// Where the noise is known: a law without which BIC is not higher by `exclusion_margin`, for the
// model without it is a rival. Else one that does not predict.
[[nodiscard]] bool is_superfluous(const SearchState& state, const ExtendedFit& without);

// Until none is superfluous, or one is left.
void prune_laws(SearchState& state);

// A law that only generalises another of fewer parameters gives way to it unless it is better
// beyond the margin; one that a sum of plainer laws imitates gives way to the sum
// (plainer_sums.hpp). Where the noise is not known, two laws at a place of which one is rare give
// way to one law there that predicts as well with fewer parameters.
void simplify_laws(SearchState& state);

}  // namespace graybox
