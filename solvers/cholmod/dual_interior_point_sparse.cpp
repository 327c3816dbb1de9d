#include "solvers/cholmod/dual_interior_point_sparse.hpp"

#include "solvers/cholmod/sparse_range_system.hpp"
#include "solvers/interior_point/dual_newton.hpp"

namespace graybox {

Solution DualInteriorPointSparse::solve(const InformationSet& set, const SolveOptions& options,
                                        SolveObserver* observer) const {
  return solve_dual(set, options, observer, {}, make_sparse_range_system);
}

}  // namespace graybox
