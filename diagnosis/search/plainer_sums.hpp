// Sums of two plainer laws in the place of one (steps 4 and 5 of the search, diagnosis_search.hpp).
//
// A law with several shape parameters can imitate the sum of two simple ones at its place: a
// Stribeck friction or one that grows less than linearly a dry one with a damper. Which laws a sum
// may be made of follows from the hypotheses. One is a special case of the law or describes the
// same characteristic. The other is the law that a score test then misses most at that place.
// Together they have no more parameters than the law.
//
// Where the noise is known the model's own stiffnesses and dampings are free, so that linear laws
// are beside every law there: no sums are tried.
#pragma once

#include <vector>

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// Fits in which two laws, the last two, stand in the place of this one of the model found; the best
// first. `without`: the model found without that law. Cost: up to kPartners + 1 refits and one
// score test a plainer law.
[[nodiscard]] std::vector<ExtendedFit> sums_of_plainer_laws(SearchState& state, std::size_t law,
                                                            const ExtendedFit& without);

// Whether a sum takes the law's place: it is of laws of a lower rank and not excluded, or predicts
// as well with fewer parameters, or better.
[[nodiscard]] bool is_preferred(const SearchState& state, std::size_t law, const ExtendedFit& sum);

// Sums that the law found does not exclude become its rivals; else the best is named as excluded.
void add_rival_sums(const SearchState& state, FoundEffect& effect,
                    const std::vector<ExtendedFit>& sums);

}  // namespace graybox
