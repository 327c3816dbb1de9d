// The first working set of column_generation: a few dozen candidates of a pool whose information
// matrix is as well conditioned as the pool's own.
//
// A few multiplicative steps (Silvey, Titterington and Torsney 1978) from equal weights on the pool
// give weights lambda with information matrix P; the heaviest few candidates then make the
// working set. On random candidates any choice of heavy ones will do. On a smooth curve the heavy
// ones stand side by side at a few places, and the matrix S of those alone can be singular to
// double precision although P is not. So the choice is tested: by
//
//   P <= tr(S^-1 P) S                              (S^-1/2 P S^-1/2 is at most its trace times I)
//
// every sensitivity with S is at most tau = tr(S^-1 P) times that with P. By the inequality of the
// arithmetic and geometric means log det S >= log det P - d log(tau / d). The ratio tau / d does
// not depend on the coordinates of the parameters, so the limit on it is a number: kLargestLoss.
//
//   1. the m heaviest, m = 3 d;
//   2. where that fails: the heaviest of each of m stretches of the pool's order, for neighbours on
//      a grid are nearly equal;
//   3. where that fails: both again with 2 m, until the whole pool is taken.
//
// Where the pool's own P is singular (candidates that inform about one parameter each), the whole
// set takes its place. Last comes the whole set with weights that give each candidate's matrix the
// same size.
//
// A design that is given takes the place of the multiplicative steps: its support becomes the
// working set. No optimal design needs more than p + 1 points (Caratheodory), so of a longer
// support only the heaviest are taken, chosen and tested as above.
//
// Cost: kSteps + 1 reads of the pool, O(m d^2 + d^3) a choice.
#pragma once

#include <span>

#include "problems/base/random.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/pricing/candidate_pool.hpp"
#include "solvers/restricted_problem/working_set.hpp"

namespace graybox {

// Fills `working`, refreshed. False where the sum of all matrices is singular in double precision.
// `random` breaks ties between candidates that are images of one another.
[[nodiscard]] bool well_conditioned_start(const InformationSet& set, const CandidatePool& pool,
                                          Random& random, Tracer& tracer, WorkingSet& working);

// Fills `working` from the weights of a design, one for each candidate, refreshed. False where the
// design's information matrix is singular in double precision. Reads the support.
[[nodiscard]] bool start_from_design(const InformationSet& set, std::span<const double> weights,
                                     Tracer& tracer, WorkingSet& working);

}  // namespace graybox
