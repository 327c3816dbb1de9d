// Information sets made to be hard: badly scaled, nearly singular, copied, rounded, degenerate.
// Every back-end runs on them, and what is called solved is compared with the gap in 60 digits.
//
//   Random random(seed);
//   const InformationSet set = hostile_set(kind, random);         // kind < hostile_kinds().size()
//   const double truth = true_gap(set, design);                   // of the design as it is
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "problems/base/random.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/core/design.hpp"

namespace graybox::testing_sets {

// The names of the kinds.
[[nodiscard]] const std::vector<std::string_view>& hostile_kinds();

// A random set of one kind, not validated: some have a singular sum or matrices that are not quite
// positive semidefinite.
[[nodiscard]] InformationSet hostile_set(std::size_t kind, Random& random);

// max_i tr(M^-1 H_i)/d - 1 over all candidates in 60 decimal digits, for the weights as certify()
// reads them: negative ones set to zero, sum one. Infinity where M is singular or the weights are
// none.
[[nodiscard]] double true_gap(const InformationSet& set, const Design& design);

// A seed from the machine's entropy.
[[nodiscard]] std::uint64_t fresh_seed();

}  // namespace graybox::testing_sets
