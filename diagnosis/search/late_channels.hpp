// Laws beside forces that come in time. A force that is recorded late, or positions that are, leave
// what no law describes, and laws stand in for it: a Stribeck curve six times too high was found in
// a drive whose encoder was 25 ms late. So, where the noise is not known, laws are sought once more
// with the channels moved (MismatchProblem::in_time), as long as the error kept out falls.
#pragma once

#include <functional>

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// `find_laws`: the search, from a state without laws.
void find_laws_in_time(SearchState& state, const std::function<void(SearchState&)>& find_laws);

}  // namespace graybox
