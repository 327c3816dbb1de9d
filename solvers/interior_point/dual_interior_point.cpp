#include "solvers/interior_point/dual_interior_point.hpp"

#include "solvers/interior_point/dual_newton.hpp"

namespace graybox {

Solution DualInteriorPoint::solve(const InformationSet& set, const SolveOptions& options,
                                  SolveObserver* observer) const {
  return solve_dual(set, options, observer, {}, make_dense_range_system);
}

}  // namespace graybox
