// Most candidates of a large set are far from the largest sensitivity. Here double precision shows
// it, with a bound of its own error, so that the checker's extended precision is left for those
// that can be the largest. What the checker states is not changed by it, to the last bit.
//
// Let X be rounded to double, y = X F^T, m = |X| |F^T| and n = k d + 2 d + 4. The computed |y|^2
// is then off by at most 4 n u |m|^2: sums of products have 3 n u (extended_information.hpp), and
// rounding X adds 2 u. For matrices a trace of p products has (p + 2 d + 5) u times its
// magnitude. Both magnitudes are bounded from the diagonals. Twice that error leaves room for the
// one of extended precision, which is 2000 times smaller. Where X leaves the range in which
// products of its entries are normal numbers, all candidates are left to extended precision.
//
//   std::vector<double> upper(set.candidate_count());
//   const double floor = sieve_sensitivities(set, information, upper);
//   if (upper[i] < floor) ...        // tr(X^T X H_i) is at most upper[i]; i is not the largest
//
// Cost: a pass over the set, bound by memory for matrices; k d (d + 3) / 2 multiplications for
// factors, eight candidates at a time.
#pragma once

#include <span>

#include "problems/information/information_set.hpp"
#include "solvers/conditioning/extended_information.hpp"

namespace graybox {

// Writes for every candidate what its sensitivity, as extended precision computes it, does not
// exceed. Returns what the largest of them is at least; minus infinity where nothing can be said,
// and `upper` is not to be used. An entry that is not finite says nothing either.
[[nodiscard]] double sieve_sensitivities(const InformationSet& set,
                                         const ExtendedInformation& information,
                                         std::span<double> upper);

}  // namespace graybox
