// Safe deletion: from any design at hand, which candidates can carry no weight in any D-optimal
// design? Deleting them changes neither the optimum nor the optimal designs.
//
// Setting. M = sum_i lambda_i H_i is positive definite, w_i = tr(M^-1 H_i), and max_i w_i = d + eps
// over all candidates (over those not yet deleted serves as well: the optimum is the same). M* is
// the optimal information matrix; it is unique, since log det is strictly concave. Write M = L L^T
// and
//
//   A = L^T M*^-1 L  (eigenvalues mu_1 .. mu_d > 0),   B_i = L^-1 H_i L^-T,   tr B_i = w_i.
//
// Three facts follow from the equivalence theorem (certificate.hpp):
//
//   tr A    = tr(M*^-1 M) = sum_i lambda_i  tr(M*^-1 H_i) <= d,            (1)
//                                                  since tr(M*^-1 H_i) <= d;
//   tr A^-1 = tr(M^-1 M*) = sum_i lambda*_i w_i           <= d + eps;      (2)
//   lambda*_i > 0 in some optimum  =>  tr(A B_i) = tr(M*^-1 H_i) = d.      (3)
//
// Harman and Pronzato 2007 (Theorem 1; for matrix-valued candidates Harman and Trnovska 2009).
// Let mu be the largest eigenvalue of A. By the Cauchy-Schwarz inequality the other d - 1, whose
// sum is at most d - mu, have sum_k 1/mu_k >= (d-1)^2/(d - mu); with (2),
//
//   1/mu + (d-1)^2/(d - mu) <= d + eps   <=>   (d + eps) mu^2 - d (2 + eps) mu + d <= 0,
//
// so mu <= mu_max, the larger root. The product of the roots is d/(d + eps), hence 1/mu_max equals
// the smaller root times (d + eps)/d:
//
//   1/mu_max = 1 + eps/2 - sqrt(eps (4 + eps - 4/d))/2,       h = d/mu_max. (4)
//
// From (3), d = tr(A B_i) <= mu_max tr B_i = mu_max w_i: a support point has w_i >= h. (For d > 1,
// mu < d because the other eigenvalues are positive. For d = 1, mu <= 1 by (1), and (4) gives 1.)
//
// The Frobenius rule uses more of H_i than its trace, and deletes far more if its rank exceeds one.
// For each eigenvalue (mu_k - 1)^2 = mu_k (mu_k - 2 + 1/mu_k) <= mu_max (mu_k - 2 + 1/mu_k), since
// the bracket is (mu_k - 1)^2/mu_k >= 0. Summed, with (1) and (2),
//
//   ||A - I||_F^2 <= mu_max (tr A - 2 d + tr A^-1) <= mu_max eps. (5)
//
// For a support point split off the trace, C_i = B_i - (w_i/d) I with tr C_i = 0:
//
//   d = tr(A B_i) = w_i + tr((A - I) B_i) = w_i + (w_i/d) tr(A - I) + tr((A - I) C_i)
//     <= w_i + sqrt(mu_max eps) ||C_i||_F,        ||C_i||_F^2 = ||B_i||_F^2 - w_i^2/d, (6)
//
// because tr(A - I) <= 0 by (1) and w_i >= 0. A candidate that violates (6) is deletable.
//
// Rounding. The sensitivities come from floating-point numbers, so both rules are loosened: the
// largest sensitivity is raised and the requirement lowered by the relative margin. They stay safe
// as long as each w_i and ||B_i||_F is known to within that margin, which holds for M of condition
// up to about 1e6 (beyond that, work in whitened coordinates: conditioned_set.hpp).
//
//   const double threshold = graybox::harman_pronzato_threshold(max_w, d);
//   if (w[i] < threshold) ...                                        // deletable
//   const graybox::FrobeniusRule rule(max_w, d);
//   if (rule.deletable(w[i], graybox::squared_whitened_norm(h, inverse_factor, d, scratch))) ...
#pragma once

#include <cstddef>
#include <span>

namespace graybox {

inline constexpr double kScreeningMargin = 1e-9;

// h of (4), lowered by the margin: a candidate with w_i below it carries no weight in any optimum.
// max_sensitivity is the largest w_i over the candidates that are left; infinity gives 0.
[[nodiscard]] double harman_pronzato_threshold(double max_sensitivity, std::size_t dimension,
                                               double margin = kScreeningMargin);

// (6), at cost O(1) a candidate once ||B_i||_F^2 is known.
class FrobeniusRule {
 public:
  FrobeniusRule(double max_sensitivity, std::size_t dimension, double margin = kScreeningMargin);

  // An upper bound of tr(M*^-1 H_i), the right-hand side of (6). Support points have at least d.
  [[nodiscard]] double bound(double sensitivity, double squared_norm) const;
  [[nodiscard]] bool deletable(double sensitivity, double squared_norm) const {
    return bound(sensitivity, squared_norm) < requirement_;
  }

 private:
  double dimension_;
  double radius_;       // sqrt(mu_max eps)
  double requirement_;  // d, lowered by the margin
};

// ||B_i||_F^2 for one packed H_i, with inverse_factor = L^-1 (packed lower triangle) and 2 d^2
// numbers of scratch. O(d^3): compute it for Harman-Pronzato survivors
// only.
[[nodiscard]] double squared_whitened_norm(const double* packed,
                                           std::span<const double> inverse_factor,
                                           std::size_t dimension, std::span<double> scratch);

}  // namespace graybox
