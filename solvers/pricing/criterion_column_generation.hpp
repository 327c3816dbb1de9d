// Column generation for all criteria but D: what column_generation does where the criterion is not
// D, nor G over the candidates, whose optimum is D's. The scheme is the same. It prices all
// candidates with tr(G H_i), adds the most violating to a working set of a few dozen and solves the
// problem there (restricted_problem.hpp). Between passes over the whole set it goes on with a short
// list of those with the largest sensitivities. It starts from a D-optimal design of gap 0.1, which
// is regular and whose support sees every direction.
//
// No candidates are removed for good: the rules of screening.hpp hold for D alone, and the short
// list is a guess that the next pass over all candidates corrects. It stops on a pass over ALL
// candidates whose gap, with what rounding may hide of it, is at most the one asked for.
//
// Rounding acts like a change of M between the factors 1 -+ e, e of sensitivity_error.hpp for the
// factor of M that is held. The gap is max_i w_i - 1, w_i = tr(G H_i), G with tr(G M) = 1. To first
// order w_i moves by at most
//
//   e w_i + c e tr(M^-1 H_i),   c = 1 + 2,   phi_p: c = 1 + max(2, p + 1)
//
// since the second derivative of the criterion in the axes of criterion_frame.hpp has
// Omega_ab <= 2, or p + 1, and since tr(G H_i) of G <= M^-1 is summed with an error of
// e tr(M^-1 H_i). Where M is nearly singular, as optima of c and Ds are, that is much. Then the run
// ends as numerical_failure, and column_generation asks the checker, which has more digits.
//
// Where rounding of the sensitivities could reach a tenth of the gap asked for, or keeps the gap
// above it, the set is whitened first (conditioned_set.hpp), and K or lambda_min transformed with
// it.
//
// Cost: 2 Q p flops and one read of the set a pass, 4 to 10 passes, one of them for the condition;
// the working set as smooth_restricted_problem.hpp and eigenvalue_restricted_problem.hpp say.
// Results do not depend on the number of threads.
#pragma once

#include "solvers/core/solver.hpp"
#include "solvers/core/tracer.hpp"

namespace graybox {

// `start`: a design with a regular information matrix. For criterion E the answer carries its
// dual_matrix, for G its dual_weights.
[[nodiscard]] Solution solve_criterion(const InformationSet& set, const SolveOptions& options,
                                       const Design& start, Tracer& tracer);

}  // namespace graybox
