// The checker (certificate.hpp) for a set whose candidates are shared out: each process certifies
// the design on its own slice, and one reduction takes the worst. The rule, its arithmetic and its
// rounding bound are certify()'s: a design's gap on a set is the largest of its gaps on parts that
// all contain the design's support.
#pragma once

#include <mpi.h>

#include <cstddef>
#include <utility>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"

namespace graybox {

// The support's candidates as a set of their own, on every process. Its form is that of the slices,
// its order that of `support` (global index, weight). Collective.
[[nodiscard]] InformationSet gather_support(
    MPI_Comm communicator, const InformationSet& slice, std::size_t first_index,
    const std::vector<std::pair<std::size_t, double>>& support);

// Collective; the same on every process. worst_candidate is a global index. One pass over the
// slices.
[[nodiscard]] Certificate certify_distributed(
    MPI_Comm communicator, const InformationSet& slice, std::size_t first_index,
    const std::vector<std::pair<std::size_t, double>>& support, double asked_gap = kFinestGap,
    int threads = 1);

}  // namespace graybox
