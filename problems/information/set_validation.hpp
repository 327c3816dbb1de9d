// The parts of InformationSet::validate(), for those who need them one by one.
#pragma once

#include <cstddef>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

// An eigenvalue this far below zero, relative to the largest, is rounding in double precision.
inline constexpr double kSemidefiniteRounding = 1e-9;

// The candidates whose matrices are not positive semidefinite to that rounding, in order. Throws
// InputError naming the first candidate that is not finite. Cost O(Q d^3).
[[nodiscard]] std::vector<std::size_t> indefinite_candidates(const InformationSet& set);

// Throws InputError where the sum of all H_i, each scaled to unit size and the sum to unit
// diagonal, is singular in double precision. The message names the combination of parameters that
// no candidate informs, and what to do. Cost O(Q d^2 + d^3).
void require_regular_sum(const InformationSet& set);

}  // namespace graybox
