// concentration_interior_point: D-optimal design under the concentration limit of
// concentration_limit.hpp, by the low-rank primal interior point (primal_newton.hpp). The paper's
// footnote 8 expects the linear cost in Q to be lost with such a constraint; it is not.
//
// Problem, with the sum of the r largest weights in the form of Boyd and Vandenberghe (2004,
// exercise 5.19), in whitened coordinates:
//
//   minimise -log det M(lambda)   subject to  1^T lambda = 1,  lambda >= 0,
//     r t + sum_i u_i + v = alpha,   a_i = u_i - lambda_i + t,   u, a, v >= 0.
//
// Multipliers nu (simplex), s (lambda), y (a), z (u), eta (budget and v). Optimality:
//
//   s = nu 1 - (tr(W B_i))_i + y,   z = eta 1 - y,   r eta = 1^T y,   W M(lambda) = I,
//   lambda s, u z, a y, v eta = mu -> 0.
//
// So 0 <= y <= eta: y_i is what the limit charges for weight on position i, all of eta where
// lambda_i > t, none where lambda_i < t, something between on the positions that tie at t.
//
// Newton's method. With p = z/u, q = y/a, kappa = q/(p + q), h = p q/(p + q), and c the targets of
// the products, the pairs (u_i, y_i) are eliminated one by one:
//
//   du = kappa (dlambda - dt) + (e - deta)/(p + q),       e = c_u/u + c_a/a
//   dy = h (dlambda - dt) + kappa deta + b,               b = (1 - kappa) c_a/a - kappa c_u/u.
//
// What is left is the Newton system of the simplex problem with h added to its diagonal, D^-1 =
// S/Lambda + diag(h), and two more bordering columns. On positions that tie, h grows without bound
// and ties dlambda_i to dt; so dlambda = delta + k dt is solved for, k = D h <= 1, which takes the
// large numbers out of the border before they can cancel:
//
//   [ K + D^-1   1      K k                          kappa             ] [ delta ]
//   [ 1^T        0      1^T k                        0                 ] [ dnu   ]
//   [ (K k)^T    1^T k  sum h (1-k) + k^T K k        r - sum kappa (1-k)] [ dt    ]
//   [ kappa^T    0      r - sum kappa (1-k)          -tau              ] [ deta  ]
//
// with tau = sum 1/(p + q) + v/eta. K + D^-1 is solved with as before, through the p x p range of K
// (make_low_rank_primal_system): three solves for the border, one for the predictor and one for the
// corrector, against one, one and one without the limit. Up to two correctors of Gondzio (1996)
// follow. Cost an iteration: one Hessian assembly, Q p^2 flops, 21 to 33 passes and one sort of Q
// numbers for the gap; linear in Q but for the sort.
//
// Start, strictly feasible and centred: lambda = 1/Q, and with rho = r/Q, y = eta rho, z = eta (1 -
// rho), all products u z = a y = v eta equal: mu = eta (alpha - rho)/(2 Q + 1). Every iterate obeys
// the limit. The gap that ends the run is the checker's, L/d - 1.
//
// Statuses as for primal_interior_point. alpha = 1 limits nothing and is handed to
// primal_interior_point_low_rank; alpha = r/Q leaves the uniform design alone. Clearing negligible
// weights keeps the limit (clear_negligible_weights()).
//
//   const auto limit = graybox::concentration_limit(0.5, 0.01, set.candidate_count());
//   const Solution answer = graybox::solve_concentrated(set, limit, {.duality_gap = 1e-8});
//   const auto proof = graybox::certify_concentrated(set, answer.design, limit);
#pragma once

#include "solvers/core/solver.hpp"
#include "solvers/robust/concentration_limit.hpp"

namespace graybox {

// Throws InputError for options out of range, or a limit that does not fit the set.
[[nodiscard]] Solution solve_concentrated(const InformationSet& set,
                                          const ConcentrationLimit& limit,
                                          const SolveOptions& options,
                                          SolveObserver* observer = nullptr);

}  // namespace graybox
