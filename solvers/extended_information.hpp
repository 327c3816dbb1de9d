// The arithmetic that every checker shares: reading the weights of a design, its information matrix
// and sensitivities in extended precision (64-bit significand), and a bound on the error of the
// latter.
//
// With X the computed inverse of the Cholesky factor of M, scaled to unit diagonal, and
// ||X M X^T - I|| <= residual() < 1, M^-1 lies between X^T X / (1 + residual) and
// X^T X / (1 - residual) in the Loewner order: each tr(M^-1 H_i) is known to within these factors,
// apart from the rounding of the trace itself, at most trace_unit() times the sum of the magnitudes
// of its terms.
//
//   const graybox::CheckedWeights checked(set, design);
//   if (!checked.message.empty()) ...                       // no design
//   const graybox::ExtendedInformation m(set, checked.weights);
//   if (!m.regular()) ...
//   const graybox::Extended w = m.sensitivity(set.information(i));
//
// Cost: O(support p + d^3) to construct, p multiplications a sensitivity.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "graybox/problems/information_set.hpp"
#include "graybox/solvers/design.hpp"

namespace graybox {

using Extended = long double;

// The weights of a design, clipped and renormalised. `message` says why they are no design: a wrong
// length, a NaN, a weight below -1e-12, or a sum that differs from one by more than 1e-9.
struct CheckedWeights {
  CheckedWeights(const InformationSet& set, const Design& design);

  std::string message;            // empty for a design
  std::vector<Extended> weights;  // non-negative, of sum 1
  std::size_t support_size = 0;   // weights above zero
  double clipped = 0.0;           // sum of the negative weights set to zero, as a positive number
  double renormalised = 0.0;      // sum of the weights minus one, before renormalising
};

class ExtendedInformation {
 public:
  // `order`, if not empty, is the order in which the d parameters are eliminated: the last k rows of
  // inverse_factor() then whiten the Schur complement of the others, the information about
  // order[d-k] .. order[d-1] that is left when the others are unknown too.
  ExtendedInformation(const InformationSet& set, std::span<const Extended> weights,
                      std::span<const std::size_t> order = {});

  // False where M is not numerically positive definite; the rest is then undefined.
  [[nodiscard]] bool regular() const { return residual_ < Extended{0.1}; }
  [[nodiscard]] Extended log_det() const { return log_det_; }
  [[nodiscard]] Extended residual() const { return residual_; }
  // tr(M^-1 H) for a packed H, and the sum of the magnitudes of its terms.
  [[nodiscard]] Extended sensitivity(std::span<const double> packed) const;
  [[nodiscard]] Extended magnitude(std::span<const double> packed) const;
  [[nodiscard]] Extended trace_unit() const;
  // X, d x d row-major: its columns are the parameters in their own order, its rows those in the
  // order of elimination.
  [[nodiscard]] std::span<const Extended> inverse_factor() const { return inverse_; }
  // The logarithm of the information about the parameter eliminated k-th, given those after it;
  // log_det() is the sum over k.
  [[nodiscard]] Extended log_pivot(std::size_t k) const { return log_pivots_[k]; }

 private:
  std::size_t dimension_;
  std::vector<Extended> inverse_;
  std::vector<Extended> log_pivots_;
  std::vector<Extended> dual_;  // M^-1 in trace-dual packing
  Extended log_det_ = 0;
  Extended residual_ = 1;
};

}  // namespace graybox
