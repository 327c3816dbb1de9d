// The primal-dual interior-point method on the paper's form (9), shared by primal_interior_point
// and primal_interior_point_low_rank, which differ only in how they solve the Newton system.
//
// Problem, in whitened coordinates (normalized_set.hpp), with linear equality constraints of which
// the simplex is the first, 1^T lambda = 1:
//
//   minimise -log det M(lambda),  M = sum_i lambda_i B_i,   subject to  F lambda = f, lambda >= 0.
//
// With W for M^-1, so that the gradient by lambda_i is -tr(W B_i), nu for the multipliers of F and
// s >= 0 for those of lambda >= 0, the optimality conditions are
//
//   s = F^T nu - (tr(W B_i))_i,    F lambda = f,    W M(lambda) = I,    lambda_i s_i = mu -> 0. (a)
//
// Newton's method on them: W M = I is linearised in the scaling of Nesterov and Todd
// (nesterov_todd.hpp), dW = G (E - dM~) G^T = G E G^T - P dM P. (Taking dW = -M^-1 dM M^-1, plain
// Newton, drives nu to zero before M has grown to its size. It cycles on sets where one candidate
// outweighs all others.) Let K_ij = tr(P B_i P B_j), which is the Hessian of -log det at M^-1 = P,
// and g_i = tr(G E G^T B_i). Elimination of dW and ds leaves
//
//   [ K + S/Lambda   F^T ] [ dlambda ]   [ c/lambda + g ]
//   [ F               0  ] [ dnu     ] = [ f - F lambda ],        lambda ds + s dlambda = c. (b)
//
// It is solved by elimination: V = (K + S/Lambda)^-1 F^T, one solve for each constraint, and the
// small Schur complement F V. Each constraint beyond the simplex is one row more of F.
//
// Two ways to K + S/Lambda, with D = diag(lambda_i/s_i) and A the Q x p matrix of the B_i in
// symmetric vectorisation (entries off the diagonal times sqrt(2)):
//
//   dense     K = C C^T, row i of C the vectorised X B_i X^T, X^T X = P. Factorise
//             D^(1/2) (K + D^-1) D^(1/2) = I + U U^T, U = D^(1/2) C: never indefinite.
//   low rank  K = A (P (x) P) A^T. By Sherman, Morrison and Woodbury
//             (K + D^-1)^-1 = D - D A (P^-1 (x) P^-1 + A^T D A)^-1 A^T D,
//             in the form of augmented_system.hpp.
//
// Predictor and corrector as in Mehrotra 1992. Start: lambda_i = 1/Q, where M = I, and W = I; nu =
// 1.1 max tr B_i, s = nu - tr B_i: feasible,
// and all of (a) but the last holds. Every lambda > 0 gives a design whose true gap is evaluated
// each iteration and ends the run; nothing relies on W. 8 to 20 iterations.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "solvers/conditioning/normalized_set.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

// F lambda = f: `count` rows of Q coefficients.
struct EqualityConstraints {
  std::size_t count = 0;
  AlignedArray rows;
  std::vector<double> right_side;
};

// The simplex: one row of ones, right side 1.
[[nodiscard]] EqualityConstraints simplex_constraint(std::size_t candidate_count);

// Solves with K + D^-1 for one iterate after another.
class PrimalSystem {
 public:
  virtual ~PrimalSystem() = default;

  // From G^-1 (d x d) and the ratios lambda_i/s_i. False where the factorisation breaks down.
  [[nodiscard]] virtual bool factorise(const Eigen::MatrixXd& inverse_scaling,
                                       std::span<const double> ratios) = 0;

  // x := (K + D^-1)^-1 x, Q numbers.
  virtual void solve(std::span<double> x) = 0;

  // Passes over the rows that one factorise() and one solve() make.
  [[nodiscard]] virtual double factorise_passes() const = 0;
  [[nodiscard]] virtual double solve_passes() const = 0;
};

using MakePrimalSystem =
    std::function<std::unique_ptr<PrimalSystem>(const NormalizedSet& normal, int threads)>;

// A system that does not fit into memory (std::bad_alloc from make_system) is `unsupported`.
[[nodiscard]] Solution solve_primal(const InformationSet& set, const SolveOptions& options,
                                    SolveObserver* observer, const MakePrimalSystem& make_system);

}  // namespace graybox
