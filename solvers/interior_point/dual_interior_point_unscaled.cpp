#include "solvers/interior_point/dual_interior_point_unscaled.hpp"

#include "solvers/interior_point/dual_newton.hpp"

namespace graybox {

Solution DualInteriorPointUnscaled::solve(const InformationSet& set, const SolveOptions& options,
                                          SolveObserver* observer) const {
  return solve_dual(set, options, observer, {.whiten = false, .scale_rows = false},
                    make_dense_range_system);
}

}  // namespace graybox
