// NormalizedSet: a working copy of an information set in coordinates fit for floating-point
// optimisation. D-optimal weights do not change under H_i -> X H_i X^T, and dividing a candidate by
// a positive number only rescales its multiplier, so both can be chosen for the conditioning:
//
//   mean:      Mbar = (1/Q) sum_i H_i = L L^T,     X = L^-1,
//   whitening: B_i = X H_i X^T, so that (1/Q) sum_i B_i = I,
//   rows:      A_i = B_i / n_i,  n_i = ||B_i||_F   (1 where B_i = 0).
//
// Why the plain mean, even for candidates spread over many decades: for the optimal M*,
// tr(M*^-1 H_i) <= d gives H_i <= d M* for every i, hence Mbar <= d M*, and M* <= Q Mbar since each
// H_i <= Q Mbar. So in whitened coordinates all eigenvalues of the optimal information matrix lie
// in
//
//   1/d <= eigenvalues of X M* X^T <= Q,
//
// whatever the scale of parameters and candidates (a mean of candidates that were normalised first
// has no such bound: it may be dominated by directions that are nearly free in the optimum). The
// paper's problem as written, without this step, fails on badly scaled sets:
// docs/explanation/normalisation.md.
//
// A problem in rows A_i and multipliers z_i, say the dual (10),
//
//   maximise log det V  subject to  tr(V A_i) <= d/n_i,
//
// is the original one with V = L^T W L, z_i = n_i lambda_i, and
// log det M = log det(sum_i lambda_i B_i) + log_det_shift.
//
//   graybox::NormalizedSet normal(set, {});
//   if (!normal.regular()) return unsupported(normal.message());
//   kernels().price(normal.rows(), normal.candidate_count(), normal.packed_size(), dual, values);
//
// The products are accumulated in extended precision where Mbar is so ill-conditioned that half of
// the digits would be lost (unit-diagonal Cholesky pivots below 1e-4), or more than the caller can
// spare. In double precision the rows are wrong by about 2 d u tr(S^-1). Here S is the mean scaled
// to unit diagonal, u = 2^-53. Cost: one pass over the set for the mean, one for the products with
// about (4/3) d^3 multiplications a candidate, one pass over the copy to scale it; Q p doubles of
// memory. Results do not depend on the number of threads.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/information/information_set.hpp"

namespace graybox {

struct NormalizedSetOptions {
  bool whiten = true;                                         // false: X = I
  bool scale_rows = true;                                     // false: n_i = 1
  double accuracy = std::numeric_limits<double>::infinity();  // relative, wanted of the rows
  int threads = 1;
};

class NormalizedSet {
 public:
  NormalizedSet(const InformationSet& set, const NormalizedSetOptions& options);

  // False if the mean information matrix is numerically singular: then no design is regular (the
  // sum of all H_i is singular), and everything below but message() is undefined.
  [[nodiscard]] bool regular() const { return message_.empty(); }
  [[nodiscard]] const std::string& message() const { return message_; }

  [[nodiscard]] std::size_t candidate_count() const { return candidate_count_; }  // Q
  [[nodiscard]] std::size_t dimension() const { return dimension_; }              // d
  [[nodiscard]] std::size_t packed_size() const { return packed_size_; }          // p

  // The A_i, packed lower triangles as in the information set, Q x p.
  [[nodiscard]] const double* rows() const { return rows_.data(); }
  [[nodiscard]] std::span<const double> row(std::size_t candidate) const {
    return {rows_.data() + candidate * packed_size_, packed_size_};
  }
  [[nodiscard]] std::span<const double> row_norms() const { return row_norms_; }  // n_i, Q
  [[nodiscard]] double log_det_shift() const { return log_det_shift_; }           // log det Mbar
  // About how far, relatively, the sensitivities are off because the rows are rounded.
  [[nodiscard]] double rounding() const { return rounding_; }

  // X, packed lower triangle: B_i = X H_i X^T.
  [[nodiscard]] std::span<const double> transform() const { return transform_; }

  // Weights on the simplex from multipliers z_i >= 0 of the rows: z_i / n_i, normalised.
  // multipliers and weights may be the same array.
  void weights_from_multipliers(std::span<const double> multipliers,
                                std::span<double> weights) const;

  // Passes over the set that the construction read, for the solver's count.
  [[nodiscard]] double passes() const { return passes_; }

 private:
  bool choose_transform(const InformationSet& set, double accuracy);
  void transform_rows(const InformationSet& set, int threads);
  void scale_rows();

  std::size_t candidate_count_;
  std::size_t dimension_;
  std::size_t packed_size_;
  AlignedArray rows_;
  std::vector<double> row_norms_;
  std::vector<double> transform_;
  double log_det_shift_ = 0.0;
  double passes_ = 0.0;
  bool ill_conditioned_ = false;
  std::string message_;
  double rounding_ = std::numeric_limits<double>::epsilon();
};

}  // namespace graybox
