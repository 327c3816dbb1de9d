// CandidatePricer: w_i = tr(M^-1 H_i) for candidates of a set, in the form that the set holds. For
// packed matrices it is the dot product with M^-1; for factors |X F_i^T|^2, X the inverse of M's
// Cholesky factor (factor_kernels.hpp). No matrix is made of a factor.
//
//   CandidatePricer pricer(set, inverse);                       // one a thread
//   pricer.price(from, count, w);
//   pricer.price(std::span(indices), w);
//
// Rounding. sensitivity_error.hpp bounds it for either form. For factors: y = X f is computed to
// within g(d) u |X| |f|, and f_k^2 <= M_kk w by Cauchy-Schwarz, so that
//
//   | |X| |f| |^2 <= w sum_j (sum_k |X_jk| sqrt(M_kk))^2 <= w d sum_k M_kk W_kk.
//
// With S = sum_k M_kk W_kk >= d the relative error of w is at most 2 g(d) u sqrt(d S), no more than
// 2 g(d) u S: of the size that the error of X itself has.
// Keeps references to both arguments. 32 d numbers of its own.
//
// What prices is p numbers, pricing_numbers(): they can be sent to where the set is.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/inverse_cholesky.hpp"

namespace graybox {

// What prices the candidates of a set in its form: X for factors, M^-1 in trace-dual packing for
// matrices.
[[nodiscard]] std::span<const double> pricing_numbers(const InformationSet& set,
                                                      const InverseCholesky& inverse);

class CandidatePricer {
 public:
  CandidatePricer(const InformationSet& set, const InverseCholesky& inverse);
  CandidatePricer(const InformationSet& set, std::span<const double> pricing_numbers);

  void price(std::size_t from, std::size_t count, double* out);
  void price(std::span<const std::size_t> candidates, double* out);

 private:
  const InformationSet& set_;
  std::span<const double> numbers_;
  std::vector<double> scratch_;
};

// ||X H X^T||_F^2 for H = F^T F of `rank` rows: the squares of the products of the rows of F X^T.
// `scratch`: rank d numbers. Cost rank d^2 / 2 + rank^2 d / 2. For rank one it is w^2.
[[nodiscard]] double squared_whitened_norm_of_factor(std::span<const double> factor,
                                                     std::size_t rank,
                                                     std::span<const double> inverse_factor,
                                                     std::span<double> scratch);

}  // namespace graybox
