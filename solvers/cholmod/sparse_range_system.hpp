// SparseRangeSystem: the p x p matrix S of range_system.hpp through CHOLMOD's sparse kernels (Chen,
// Davis, Hager and Rajamanickam 2008). A^T D A is the product of a sparse p x Q matrix of columns
// sqrt(D_i) a_i with its transpose. Entries that are exactly zero are not stored. N is added to it.
// The sum is scaled to unit diagonal and factorised, after one symbolic analysis.
#pragma once

#include <memory>

#include "solvers/interior_point/range_system.hpp"

namespace graybox {

[[nodiscard]] std::unique_ptr<RangeSystem> make_sparse_range_system(const NormalizedSet& normal,
                                                                    int threads);

}  // namespace graybox
