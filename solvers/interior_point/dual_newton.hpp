// The primal-dual interior-point method on the paper's dual (10), shared by dual_interior_point,
// dual_interior_point_sparse and dual_interior_point_unscaled, which differ in the coordinates and
// in how they solve one p x p linear system an iteration.
//
// Problem. In the coordinates of a NormalizedSet (rows A_i = X H_i X^T / n_i, b_i = d/n_i), (10) is
//
//   minimise -log det W   subject to  tr(W A_i) + s_i = b_i,  s_i >= 0,  W > 0,
//
// with Lagrange multipliers z_i >= 0. Setting the derivative by W to zero gives W^-1 = M(z) with
// M(z) = sum_i z_i A_i. So z_i / n_i are, up to their sum, the weights lambda_i of (9) (paper,
// after (10)); at the optimum d = tr(W M) = sum_i z_i b_i = d sum_i lambda_i, so that they sum to
// one. Both conditions are kept as complementarity pairs:
//
//   W M(z) = I,     s_i z_i = mu -> 0.                                                     (a)
//
// Every z > 0 gives a design whose true gap max_i tr(M^-1 H_i)/d - 1 is evaluated each iteration
// and ends the run; nothing relies on W.
//
// Direction. W M = I is linearised in the scaling of Nesterov and Todd (nesterov_todd.hpp), which
// gives, with P the geometric mean of M^-1 and W and P = G G^T,
//
//   dW~ + dM~ = E,      E = diag(1/v - v),        dW~ = G^-1 dW G^-T,  dM~ = G^T dM G.     (b)
//
// (Newton's plain dW -> W^-1 dW W^-1 instead of P^-1 dW P^-1 lets mu run ahead of W^-1 = M. It jams
// near the boundary on sets with a few dominant candidates.) Let dM = sum_i dz_i A_i, ds_i =
// -tr(A_i dW), z_i ds_i + s_i dz_i = c_i and t_i = -c_i/z_i. This is
//
//   P^-1 dW P^-1 + sum_i dz_i A_i = G^-T E G^-1,     tr(A_i dW) - (s_i/z_i) dz_i = t_i,        (c)
//
// the system of augmented_system.hpp, which reduces it to the p entries of dW: one p x p matrix
// P^-1 (x) P^-1 + sum_i (z_i/s_i) a_i a_i^T.
//
// Predictor and corrector (Mehrotra 1992): first c_i = -s_i z_i, which gives
// sigma = (mu_predicted/mu)^3; then c_i = sigma mu - s_i z_i - ds_i dz_i and E with its
// second-order term.
//
// Start: W = theta I with theta = d / (1.1 max_i n_i tr A_i), strictly feasible, and
// lambda_i = 1/(theta Q). In whitened coordinates M = I/theta, so (a) holds to within a factor of
// eleven from the first iteration on; steps keep tr(W A_i) + s_i = b_i, and M > 0 follows from z >
// 0.
//
// Cost an iteration: one Hessian assembly (Q p^2 flops), p^3/3 for the factor and six more passes
// over the rows; 8 to 20 iterations. Memory: a copy of the set and some vectors of length Q and
// p^2.
#pragma once

#include "solvers/conditioning/normalized_set.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/interior_point/range_system.hpp"

namespace graybox {

// coordinates.threads is taken from options.
[[nodiscard]] Solution solve_dual(const InformationSet& set, const SolveOptions& options,
                                  SolveObserver* observer, NormalizedSetOptions coordinates,
                                  const MakeRangeSystem& make_system);

}  // namespace graybox
