// Candidates named in words, as users write them on a command line and in files:
//
//   "12, 40-45"              indices, counted from zero, and ranges of them
//   "q1 > 90 & q2 <= 0"      conditions on the candidates' coordinates, all of which must hold
//   "3, q1 > 90"             commas join: whatever is named by one of them
//   "12:2, 40-45"            with a count each (one where none is given), for require
//
// The coordinates are the columns of the set's candidate table (information_set.hpp).
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

// Ascending, without repetition. `what` begins the message: throws InputError for an index out of
// range, a name that is no coordinate, and where nothing is selected.
[[nodiscard]] std::vector<std::size_t> select_candidates(const InformationSet& set,
                                                         std::string_view text,
                                                         std::string_view what);

// Likewise with counts: Q numbers, zero where a candidate is not named.
[[nodiscard]] std::vector<double> select_counts(const InformationSet& set, std::string_view text,
                                                std::string_view what);

}  // namespace graybox
