// The design that is best under one criterion and keeps others above a floor: efficiency_floor.hpp.
//
// The dual function
//
//   q(u) = max over designs of  log Phi_0 + sum_k u_k (log Phi_k - b_k)
//
// is convex in the multipliers, with the slopes e_k = log Phi_k - b_k at the design that attains
// it, and each value is a compound design (column_generation). One multiplier after another is
// moved to where its floor is met (e_k = 0, or u_k = 0 and e_k >= 0), by the Illinois method on the
// share t of floor k in the compound, in which e_k rises. One floor takes one such search. Several
// take rounds of them: coordinate descent on a smooth convex function.
//
//   std::vector<EfficiencyFloor> floors{{.share = 0.9, .criterion = Criterion::a()}};
//   const Solution d = solve_floored(set, Criterion(), {.duality_gap = 1e-6}, floors);
//
// Cost: about 10 compound designs for one floor.
#pragma once

#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/floors/efficiency_floor.hpp"

namespace graybox {

// `options.criterion` is criterion 0; the multipliers are written into `floors`. kSolved is a
// claim, as of any back-end: certify_floored() judges it. Throws InputError as require_fits(), and
// where the floors are proven to contradict each other.
[[nodiscard]] Solution solve_floored(const InformationSet& set, const SolveOptions& options,
                                     std::vector<EfficiencyFloor>& floors,
                                     SolveObserver* observer = nullptr);

}  // namespace graybox
