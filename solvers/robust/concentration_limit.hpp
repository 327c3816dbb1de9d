// The concentration limit of the paper's Section VI-D (Boyd and Vandenberghe 2004, Section 7.5.2):
// no more than the share alpha of all experiments in any r of the Q positions,
//
//   sum of the r largest lambda_i <= alpha,   r = floor(beta Q).
//
// With the simplex this is a polytope P, non-empty where alpha >= r/Q, the share of r positions in
// the uniform design; at alpha = r/Q it holds that design alone, at alpha = 1 it is the simplex. A
// design that obeys the limit has weight on at least r/alpha positions.
//
// Linear functions on P. To maximise sum_i w_i lambda_i, sort w in descending order. P and the
// simplex are symmetric under permutations, so some maximiser is sorted likewise, and a
// non-increasing lambda is a mixture of uniform designs on the first k positions: lambda = sum_k
// x_k u_k, u_k = (1/k) on 1..k, x >= 0, sum_k x_k = 1. The r largest weights of u_k sum to g_k =
// min(1, r/k), those of the sorted mixture to sum_k x_k g_k, and with the mean A_k = (w_1 + ... +
// w_k)/k the problem is
//
//   maximise sum_k x_k A_k   subject to   sum_k x_k = 1,  sum_k x_k g_k <= alpha,  x >= 0,
//
// two constraints, so at most two x_k are non-zero: the answer is the upper concave envelope of the
// points (g_k, A_k) at alpha (A_k and g_k both fall with k, so that the limit binds). O(Q log Q).
// Its slope eta is the price of the limit, and for any eta >= 0 whatsoever
//
//   max over P <= max_k (A_k - eta g_k) + eta alpha,                                          (1)
//
// which is what the checker evaluates.
#pragma once

#include <cstddef>
#include <span>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/conditioning/extended_information.hpp"

namespace graybox {

struct ConcentrationLimit {
  double share = 1.0;         // alpha
  std::size_t positions = 1;  // r
};

// r from the fraction beta of all candidates. Throws InputError unless 0 < alpha <= 1,
// 0 < beta <= 1, beta Q >= 1 and alpha >= r/Q.
[[nodiscard]] ConcentrationLimit concentration_limit(double largest_share, double of_positions,
                                                     std::size_t candidate_count);

// The sum of the r largest weights.
[[nodiscard]] double concentration(std::span<const double> weights, std::size_t positions);

struct LinearMaximum {
  Extended value = 0;  // the bound (1), attained
  Extended price = 0;  // eta
};

// The maximum of sum_i gains_i lambda_i over P; gains >= 0, one for each of the Q candidates.
[[nodiscard]] LinearMaximum maximise_over_limit(std::span<const Extended> gains,
                                                const ConcentrationLimit& limit);

// The checker for D-optimality under the limit. With w_i = tr(M^-1 H_i) and L the maximum of
// sum_i w_i lambda'_i over P, every design lambda' of P has tr(M^-1 M') <= L, hence by the
// inequality of the arithmetic and geometric mean
//
//   log det M' - log det M <= d log(tr(M^-1 M')/d) <= d log(L/d),
//
// so that duality_gap = L/d - 1 means for P what max_i w_i/d - 1 means for the simplex
// (certificate.hpp): D-efficiency >= 1/(1 + duality_gap) among all designs that obey the limit. A
// design whose r heaviest positions exceed alpha by more than 1e-9 is kNotADesign.
struct ConcentrationCertificate {
  Certificate certificate;
  double concentration = 0.0;  // sum of the r largest weights
  double price = 0.0;          // eta: about how fast log det rises with alpha
};
[[nodiscard]] ConcentrationCertificate certify_concentrated(const InformationSet& set,
                                                            const Design& design,
                                                            const ConcentrationLimit& limit);

}  // namespace graybox
