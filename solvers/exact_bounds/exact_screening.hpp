// Which candidates can appear in an optimal exact design, and how often at most. This is rule (6)
// of box_bound.hpp, from the relaxed problem's solution and one good design, over the whole set.
//
//   const CountLimits limits = screen_counts(relaxation, 20, incumbent_log_det);
//   limits.candidates;   // survivors, ascending
//   limits.upper;        // the most repetitions of each of them
//
// Safe: every design of M experiments with log det M(m) >= incumbent_log_det lies inside the
// limits, all optimal designs among them. Sensitivities are taken to be known to kScreeningMargin
// (relative), which they are for M(lambda) of condition up to 1e9 (they come from extended
// precision). O(Q).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/exact_bounds/relaxation.hpp"

namespace graybox {

struct CountLimits {
  std::vector<std::size_t> candidates;
  std::vector<std::int32_t> upper;
};

// incumbent_log_det may be minus infinity: then all candidates are left, M times each.
[[nodiscard]] CountLimits screen_counts(const Relaxation& relaxation, std::int64_t experiments,
                                        double incumbent_log_det);

// Leaves only the first of candidates whose matrices are equal to the last bit: a run of one is a
// run of the other. Rule (6) bounds the sum of their counts by the same number.
void drop_copies(const InformationSet& set, CountLimits& limits);

}  // namespace graybox
