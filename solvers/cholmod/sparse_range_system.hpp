// SparseRangeSystem: the p x p matrix S of range_system.hpp through CHOLMOD's sparse kernels (Chen,
// Davis, Hager and Rajamanickam 2008): A^T D A as the product of a sparse p x Q matrix of columns
// sqrt(D_i) a_i, in which entries that are exactly zero are not stored, with its transpose; the sum
// with N; and the factor of the sum, scaled to unit diagonal, after one symbolic analysis.
#pragma once

#include <memory>

#include "solvers/interior_point/range_system.hpp"

namespace graybox {

[[nodiscard]] std::unique_ptr<RangeSystem> make_sparse_range_system(const NormalizedSet& normal,
                                                                    int threads);

}  // namespace graybox
