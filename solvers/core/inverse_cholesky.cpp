#include "solvers/core/inverse_cholesky.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/base/packed_matrix.hpp"

namespace graybox {

InverseCholesky::InverseCholesky(std::size_t dimension)
    : dimension_(dimension),
      factor_(packed_size(dimension)),
      inverse_(packed_size(dimension)),
      dual_(packed_size(dimension)) {}

bool InverseCholesky::cholesky(std::span<const double> packed, double& log_det) {
  // A pivot this much smaller than its diagonal entry is rounding.
  const double smallest =
      4.0 * static_cast<double>(dimension_) * std::numeric_limits<double>::epsilon();
  double product = 1.0;  // of pivots: one logarithm for all, unless it would leave the range
  log_det = 0.0;
  for (std::size_t i = 0; i < dimension_; ++i) {
    double* row = factor_.data() + packed_index(i, 0);
    const double* source = packed.data() + packed_index(i, 0);
    double pivot = source[i];
    for (std::size_t j = 0; j < i; ++j) {
      const double* other = factor_.data() + packed_index(j, 0);
      double value = source[j];
      for (std::size_t k = 0; k < j; ++k) value -= row[k] * other[k];
      row[j] = value * other[j];
      pivot -= row[j] * row[j];
    }
    if (!(pivot > smallest * source[i]) || !(pivot > 0.0)) return false;
    row[i] = 1.0 / std::sqrt(pivot);
    if (pivot > 1e-12 && pivot < 1e12 && product > 1e-200 && product < 1e200) {
      product *= pivot;
    } else {
      log_det += std::log(pivot);
    }
  }
  log_det += std::log(product);
  return std::isfinite(log_det);
}

double InverseCholesky::log_det_of(std::span<const double> packed) {
  double log_det = 0.0;
  return cholesky(packed, log_det) ? log_det : -std::numeric_limits<double>::infinity();
}

bool InverseCholesky::factor(std::span<const double> packed) {
  if (!cholesky(packed, log_det_)) return false;
  invert();
  return true;
}

// Rows of X: X_i = (e_i - sum_{k<i} L_ik X_k) / L_ii; W is the sum of the rows' outer products.
void InverseCholesky::invert() {
  const std::size_t d = dimension_;
  for (std::size_t i = 0; i < d; ++i) {
    const double* l = factor_.data() + packed_index(i, 0);
    double* x = inverse_.data() + packed_index(i, 0);
    std::fill(x, x + i, 0.0);
    for (std::size_t k = 0; k < i; ++k) {
      const double* above = inverse_.data() + packed_index(k, 0);
      for (std::size_t j = 0; j <= k; ++j) x[j] -= l[k] * above[j];
    }
    for (std::size_t j = 0; j < i; ++j) x[j] *= l[i];
    x[i] = l[i];
  }
  std::ranges::fill(dual_, 0.0);
  for (std::size_t k = 0; k < d; ++k) {
    const double* x = inverse_.data() + packed_index(k, 0);
    for (std::size_t i = 0; i <= k; ++i) {
      double* w = dual_.data() + packed_index(i, 0);
      const double twice = 2.0 * x[i];
      for (std::size_t j = 0; j < i; ++j) w[j] += twice * x[j];
      w[i] += x[i] * x[i];
    }
  }
}

}  // namespace graybox
