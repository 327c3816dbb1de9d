// ConditionedSet: the problem in coordinates in which plain double arithmetic is accurate enough.
//
// The problem does not change under H_i -> R H_i R^T (log det shifts by a constant, sensitivities
// stay), but rounding does. Inverting M of condition number c, after scaling to unit diagonal,
// gives sensitivities to about d u c, u = 2.2e-16. Let U be the information matrix of the uniform
// design. With R U R^T = I every optimal M* is well conditioned whatever the units, the
// correlations and the spread of the candidates:
//
//   M* <= Q U                        since each optimal weight is at most 1 = Q (1/Q),
//   tr(M*^-1 U) <= d                 by the equivalence theorem, so U <= d M*,
//
// hence the eigenvalues of R M* R^T lie in [1/d, Q].
//
// In factor form the copy is of factors, R F_i^T, computed likewise.
//
// Whitening costs the arithmetic of many passes and a copy of the set, so it is done only if d u c
// for U exceeds the accuracy asked for. R comes from extended precision and is then rounded: any
// regular R will do. R H_i R^T is computed with twice the digits of double precision
// (twofold_congruence.hpp): cancellation would otherwise bring back the error it is to remove.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/tracer.hpp"

namespace graybox {

class ConditionedSet {
 public:
  // `accuracy`: relative error that sensitivities may have. Reads the set once, four times if it
  // whitens, and counts that. Throws InputError if the set holds a NaN or infinity, or if the sum
  // of its matrices, each scaled to unit size, is singular (as InformationSet::validate()). Keeps a
  // reference to `set`.
  ConditionedSet(const InformationSet& set, double accuracy, Tracer& tracer, int threads = 1);

  // The set to solve: the original, or the whitened copy. Same candidates in the same order.
  [[nodiscard]] const InformationSet& set() const { return copy_ ? *copy_ : original_; }
  [[nodiscard]] bool whitened() const { return copy_.has_value(); }

  // R, d x d row-major lower triangular, of the whitened copy; empty where there is none.
  [[nodiscard]] std::span<const double> coordinates() const { return coordinates_; }

  // Information matrix of the uniform design, packed, in the coordinates of set().
  [[nodiscard]] std::span<const double> uniform_information() const { return uniform_; }

 private:
  void whiten(int threads);

  const InformationSet& original_;
  std::optional<InformationSet> copy_;
  std::vector<double> uniform_;
  std::vector<double> coordinates_;
};

// The sum of all matrices, packed, in extended precision: of factors the sum of F^T F.
[[nodiscard]] std::vector<long double> extended_sum(const InformationSet& set);

// The candidates in coordinates `r`, d x d row-major lower triangular: R H_i R^T or F_i R^T, each
// rounded once. Nothing where it was asked to stop (stop.hpp).
[[nodiscard]] std::optional<InformationSet> in_coordinates(const InformationSet& set,
                                                           std::span<const double> r, int threads);

// Sensitivities are wanted this much more accurate than the gap that is to be reached.
inline constexpr double kSensitivityAccuracy = 1e-3;

}  // namespace graybox
