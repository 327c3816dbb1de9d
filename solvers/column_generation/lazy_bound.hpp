// LazyBound: certified without reading all candidates again.
//
// A pass over the whole set with a design of information matrix M_1 leaves the sensitivities
// w_i = tr(M_1^-1 H_i) behind. When a later design with matrix M_2 is to be certified, most
// candidates need not be read, for w_i bounds their new sensitivities.
//
// Lemma. Let M_1 and M_2 be positive definite, and kappa the largest eigenvalue of
// L_2^-1 M_1 L_2^-T, M_2 = L_2 L_2^T. For every positive semidefinite H,
//
//   tr(M_2^-1 H) <= kappa tr(M_1^-1 H),
//
// and no smaller kappa will do for all H.
//
// Proof. L_2^-1 M_1 L_2^-T <= kappa I, so M_1 <= kappa M_2. Inversion reverses the order of
// positive definite matrices: M_2^-1 <= kappa M_1^-1. With H = G G^T, the matrix
// G^T (kappa M_1^-1 - M_2^-1) G is positive semidefinite, and its trace is not negative. Let v be
// the eigenvector of kappa and x = L_2 v. Then H = x x^T has tr(M_2^-1 H) = |v|^2, and
// tr(M_1^-1 H) = v^T (L_2^-1 M_1 L_2^-T)^-1 v = |v|^2 / kappa.
//
// Corollary. Let the gap asked for be eps. A candidate with w_i < d (1 + eps) / kappa has
// tr(M_2^-1 H_i) < d (1 + eps): it can't be what keeps M_2 from being certified. So
//
//   max over the others of tr(M_2^-1 H_i) <= d (1 + eps)
//
// proves the gap of M_2 over all candidates as a pass over the whole set would. The nearer M_1 is
// to M_2, the nearer is kappa to 1 and the fewer are left.
//
// Rounding: w_i is known to within the share error_1 (sensitivity_error.hpp). kappa, computed from
// M_1 and the factor of M_2, is known to within error_2 and the d u of the eigenvalues. The
// threshold is lowered by more than their sum. The checker (certificate.hpp) does not use the
// bound: it reads all.
//
// Bounds on old values that save their evaluation are the lazy greedy algorithm's (Minoux 1978).
// For enclosing balls there is the distance filtering of Kallberg and Larsson (2015).
// Cost: d^3 a test, and one look at Q numbers instead of Q p.
#pragma once

#include <span>
#include <vector>

#include "solvers/restricted_problem/working_set.hpp"

namespace graybox {

class LazyBound {
 public:
  // The design with which a share of the candidates has just been priced.
  explicit LazyBound(const WorkingSet& design);

  // The sensitivity then below which a candidate's sensitivity at `design` is certainly at most
  // `level`. Minus infinity where rounding leaves no bound.
  [[nodiscard]] double threshold(const WorkingSet& design, double level) const;

 private:
  std::vector<double> matrix_;  // M_1, packed
  double error_ = 0.0;          // error_1
};

// The largest eigenvalue of X M X^T, X packed lower triangular.
[[nodiscard]] double largest_ratio(std::span<const double> packed,
                                   std::span<const double> inverse_factor, std::size_t dimension);

}  // namespace graybox
