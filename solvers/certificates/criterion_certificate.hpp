// The equivalence theorems of all criteria but D (certificate.hpp) in the checker's arithmetic;
// certify() is the one to call.
//
// Every criterion has a matrix Z with G = Z Z^T up to a factor, so that w_i = tr(Z^T H_i Z) can't
// be negative. X is the computed inverse factor, ||X M X^T - I|| <= delta < 0.1
// (extended_information .hpp), B_i = X H_i X^T, T = (X M X^T)^-1, so that M^-1 = X^T T X and ||T -
// I|| <= eta = delta/(1 - delta); a_i = tr(B_i).
//
//   A, L   (I, c alike) Z = X^T (X K), V = X K (X K)^T. The true w_i is tr(T V T B_i), and
//          |tr((T V T - V) B_i)| <= 2 eta |V^(1/2)| |V^(1/2) B_i^(1/2)|_F |B_i^(1/2)|_F + ...
//                                <= 2 eta sqrt(phi w_i a_i) + eta^2 phi a_i;
//          the true phi is tr(T V), within eta tr V.
//   Ds     with the nuisance parameters eliminated first, Z = the last s rows of X, transposed. The
//          true w_i is the difference of tr(M^-1 H_i) and tr(M_nn^-1 H_i,nn), each known to within
//          the factors 1/(1 -+ delta) from X and its leading block: error at most
//          delta (a_i + b_i)/(1 - delta) <= 2 eta a_i.
//   phi_p, G, compound   dual_bound.hpp: bounds that hold for any Z, with an error of their own.
//   E      lambda_min(M) = 1/lambda_max(X^T T X), within the factors 1 -+ delta of
//          1/lambda_max(X X^T); Z is the factor of the repaired E: no error of its own.
//
// Rounding of the traces: trace unit times sum_ab (|Z| |Z|^T)_ab |H_i,ab|.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/core/design.hpp"

namespace graybox {

// Ds: the nuisance parameters, then those of interest. Empty, the natural order, for the others.
[[nodiscard]] std::vector<std::size_t> elimination_order(const InformationSet& set,
                                                         const Criterion& criterion);

// How many factors the determinant has in which the criterion measures: d for D, s for Ds; NaN for
// the others.
[[nodiscard]] double log_det_size(const InformationSet& set, const Criterion& criterion);

// The candidates that a pass reads: the first `count`, or those listed.
class CandidateList {
 public:
  explicit CandidateList(std::size_t count_, std::span<const std::size_t> indices = {})
      : count(count_), indices_(indices) {}
  [[nodiscard]] std::size_t operator[](std::size_t k) const {
    return indices_.empty() ? k : indices_[k];
  }

  const std::size_t count;

 private:
  std::span<const std::size_t> indices_;
};

// How large each sensitivity can be, and how large the largest is at least.
struct SensitivityBounds {
  std::vector<double> upper;  // of the candidates that were read; Q numbers
  double largest = 0.0;
};

// Fills in criterion_value, duality_gap, rounding_bound, worst_candidate, dual_repair and the
// bounds for a regular information matrix, factorised in elimination_order(). Not for D, nor for G
// without a region; in quadruple precision not for E.
template <class Real>
void price_criterion(const InformationSet& set, const Design& design, const Criterion& criterion,
                     const InformationIn<Real>& information, const CandidateList& candidates,
                     SensitivityBounds& bounds, Certificate& certificate);

}  // namespace graybox
