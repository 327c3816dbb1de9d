// The arithmetic that every checker shares. It reads the weights of a design and computes its
// information matrix and sensitivities in extended precision (64-bit significand). It also bounds
// the error of the latter.
//
// Let X be the computed inverse of the Cholesky factor of M, scaled to unit diagonal, with ||X M
// X^T - I|| <= residual() < 1. Then M^-1 lies between X^T X / (1 + residual) and X^T X / (1 -
// residual) in the Loewner order. Each tr(M^-1 H_i) is known to within these factors, apart from
// the rounding of the trace itself. That is at most trace_unit() times the sum of the magnitudes of
// its terms.
//
//   const graybox::CheckedWeights checked(set, design);
//   if (!checked.message.empty()) ...                       // no design
//   const graybox::ExtendedInformation m(set, checked.weights);
//   if (!m.regular()) ...
//   const graybox::Extended w = m.sensitivity(set, i);
//
// A set in factor form is summed and priced by its factors: w = |y|^2, y = X F^T, whose entries are
// sums of d products. With m = |X| |F^T| the computed y is off by at most g(d) m. So w is off by at
// most g(k d + 2 d) 3 |m|^2, the magnitude of the terms, and by Cauchy-Schwarz
//
//   |m|^2 = sum_j (sum_a |X_ja| |f_a|)^2 <= d sum_a W_aa f_a^2,
//
// the same bound from the diagonals as for matrices. No error of forming F^T F enters, and the
// problem that is certified is the one of the factors.
//
// Cost: O(support p + d^3) to construct, p multiplications a sensitivity (k p in factor form). In
// quadruple precision each takes about a hundred times as long.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/design.hpp"

namespace graybox {

using Extended = long double;

// The weights of a design, clipped and renormalised. Where they are no design, `message` says why:
// a wrong length, a NaN, a weight below -1e-12, or a sum that differs from one by more than 1e-9.
struct CheckedWeights {
  CheckedWeights(const InformationSet& set, const Design& design);

  std::string message;            // empty for a design
  std::vector<Extended> weights;  // non-negative, of sum 1
  std::size_t support_size = 0;   // weights above zero
  double clipped = 0.0;           // sum of the negative weights set to zero, as a positive number
  double renormalised = 0.0;      // sum of the weights minus one, before renormalising
};

// Real: Extended, or Quadruple (quadruple.hpp) where that is not enough.
template <class Real>
class InformationIn {
 public:
  // If not empty, `order` is the order in which the d parameters are eliminated. The last k rows of
  // inverse_factor() then whiten the Schur complement of the others. That is the information about
  // order[d-k] .. order[d-1] that is left when the others are unknown too.
  InformationIn(const InformationSet& set, std::span<const Extended> weights,
                std::span<const std::size_t> order = {});

  // False where M is not numerically positive definite; the rest is then undefined.
  [[nodiscard]] bool regular() const { return residual_ < Real(0.1); }
  [[nodiscard]] Real log_det() const { return log_det_; }
  [[nodiscard]] Real residual() const { return residual_; }
  // tr(M^-1 H) for a packed H, and the sum of the magnitudes of its terms.
  [[nodiscard]] Real sensitivity(std::span<const double> packed) const;
  [[nodiscard]] Real magnitude(std::span<const double> packed) const;
  [[nodiscard]] Real trace_unit() const;
  // No less than magnitude() for a positive semidefinite H, from the diagonals alone: by
  // Cauchy-Schwarz (sum_a sqrt(W_aa H_aa))^2 <= d sum_a W_aa H_aa.
  [[nodiscard]] double largest_magnitude(std::span<const double> packed) const;
  // The same of a candidate, in the form that the set holds.
  [[nodiscard]] Real sensitivity(const InformationSet& set, std::size_t candidate) const;
  [[nodiscard]] Real magnitude(const InformationSet& set, std::size_t candidate) const;
  [[nodiscard]] Real trace_unit(const InformationSet& set) const;
  [[nodiscard]] double largest_magnitude(const InformationSet& set, std::size_t candidate) const;
  // X, d x d row-major: its columns are the parameters in their own order, its rows those in the
  // order of elimination.
  [[nodiscard]] std::span<const Real> inverse_factor() const { return inverse_; }
  // W = M^-1: in trace-dual packing, and its diagonal.
  [[nodiscard]] std::span<const Real> dual() const { return dual_; }
  [[nodiscard]] std::span<const double> diagonal() const { return diagonal_; }
  // The logarithm of the information about the parameter eliminated k-th, given those after it;
  // log_det() is the sum over k.
  [[nodiscard]] Real log_pivot(std::size_t k) const { return log_pivots_[k]; }

 private:
  std::size_t dimension_;
  std::vector<Real> inverse_;
  std::vector<Real> log_pivots_;
  std::vector<Real> dual_;  // M^-1 in trace-dual packing
  std::vector<double> diagonal_;
  bool triangular_ = true;  // X, where no order was given
  Real log_det_ = 0;
  Real residual_ = 1;
};

using ExtendedInformation = InformationIn<Extended>;

}  // namespace graybox
