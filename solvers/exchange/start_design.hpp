// A regular starting design of at most d candidates for the exchange methods, after Kumar and
// Yildirim 2005 (their initialisation of the minimum-volume ellipsoid), for matrix-valued
// candidates.
//
// U is the information matrix of the uniform design, M_k the sum of the first k choices, both in
// coordinates with U = I. Choice k + 1 maximises v^T H_i v, v the eigenvector of M_k to its
// smallest eigenvalue (tr H_i for the first). While M_k is singular, v is in its null space. The
// mean of v^T H_i v over all candidates is v^T U v = 1, so the choice has v^T H_i v >= 1 and the
// null space loses a dimension. After d choices M_d is regular, whatever ties, duplicates and ranks
// there are.
//
// Cost: d passes over the set.
#pragma once

#include <cstddef>
#include <vector>

#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/core/tracer.hpp"

namespace graybox {

// d indices, with repetitions where a candidate was chosen again. Throws InputError if the sum of
// the matrices is singular.
[[nodiscard]] std::vector<std::size_t> start_design(const ConditionedSet& conditioned,
                                                    Tracer& tracer);

}  // namespace graybox
