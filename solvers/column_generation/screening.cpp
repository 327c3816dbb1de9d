#include "solvers/column_generation/screening.hpp"

#include <algorithm>
#include <cmath>

#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

// eps of the header, raised by the margin; never below zero, which it is but for rounding.
double raised_excess(double max_sensitivity, double d, double margin) {
  return std::max(max_sensitivity * (1.0 + margin) - d, margin * d);
}

// 1/mu_max of (4). The difference of nearly equal terms for large eps is avoided: it is the smaller
// root of x^2 - (2 + eps) x + (1 + eps/d) = 0, the product of the roots over the larger one.
double inverse_largest_eigenvalue(double excess, double d) {
  if (std::isinf(excess)) return 0.0;
  const double discriminant = std::sqrt(std::max(excess * (4.0 + excess - 4.0 / d), 0.0));
  return 2.0 * (1.0 + excess / d) / (2.0 + excess + discriminant);
}

}  // namespace

double harman_pronzato_threshold(double max_sensitivity, std::size_t dimension, double margin) {
  const double d = static_cast<double>(dimension);
  if (!(max_sensitivity >= 0.0) || std::isinf(max_sensitivity)) return 0.0;
  const double excess = raised_excess(max_sensitivity, d, margin);
  return d * inverse_largest_eigenvalue(excess, d) * (1.0 - margin);
}

FrobeniusRule::FrobeniusRule(double max_sensitivity, std::size_t dimension, double margin)
    : dimension_(static_cast<double>(dimension)), requirement_(dimension_ * (1.0 - margin)) {
  const double excess = raised_excess(max_sensitivity, dimension_, margin);
  radius_ = std::sqrt(excess / inverse_largest_eigenvalue(excess, dimension_)) * (1.0 + margin);
}

double FrobeniusRule::bound(double sensitivity, double squared_norm) const {
  const double trace_free = squared_norm - sensitivity * sensitivity / dimension_;
  // Cancellation leaves an error of the order of squared_norm's rounding under the root.
  const double rounding = 1e-14 * squared_norm;
  return sensitivity + radius_ * std::sqrt(std::max(trace_free, 0.0) + rounding);
}

double squared_whitened_norm(const double* packed, std::span<const double> inverse_factor,
                             std::size_t dimension, std::span<double> scratch) {
  const std::size_t d = dimension;
  double* full = scratch.data();
  double* product = full + d * d;  // L^-1 H
  unpack(packed, d, full);
  for (std::size_t i = 0; i < d; ++i) {
    double* row = product + i * d;
    std::fill_n(row, d, 0.0);
    for (std::size_t k = 0; k <= i; ++k) {
      const double factor = inverse_factor[packed_index(i, k)];
      for (std::size_t j = 0; j < d; ++j) row[j] += factor * full[k * d + j];
    }
  }
  double total = 0.0;
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double entry = 0.0;
      for (std::size_t k = 0; k <= j; ++k)
        entry += product[i * d + k] * inverse_factor[packed_index(j, k)];
      total += (i == j ? 1.0 : 2.0) * entry * entry;
    }
  }
  return total;
}

}  // namespace graybox
