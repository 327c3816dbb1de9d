#include "graybox/solvers/scaled_factor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "graybox/problems/packed_matrix.hpp"

namespace graybox {

ScaledFactor::ScaledFactor(std::size_t dimension)
    : dimension_(dimension),
      factor_(dimension * dimension),
      scale_(dimension),
      inverse_factor_(dimension * dimension),
      trace_dual_(packed_size(dimension)) {}

bool ScaledFactor::factorise(std::span<const double> packed) {
  if (!cholesky(packed)) return false;
  invert();
  return true;
}

bool ScaledFactor::cholesky(std::span<const double> packed) {
  const std::size_t d = dimension_;
  const double smallest_pivot =
      4.0 * static_cast<double>(d) * std::numeric_limits<double>::epsilon();
  log_det_ = 0.0;
  for (std::size_t i = 0; i < d; ++i) {
    const double diagonal = packed[packed_index(i, i)];
    if (!(diagonal > 0.0) || !std::isfinite(diagonal)) return false;
    scale_[i] = 1.0 / std::sqrt(diagonal);
    log_det_ += std::log(diagonal);
  }
  for (std::size_t i = 0; i < d; ++i) {
    double* row = factor_.data() + i * d;
    for (std::size_t j = 0; j <= i; ++j) {
      const double* other = factor_.data() + j * d;
      double value = packed[packed_index(i, j)] * scale_[i] * scale_[j];
      for (std::size_t k = 0; k < j; ++k) value -= row[k] * other[k];
      if (i > j) {
        row[j] = value / other[j];
        continue;
      }
      if (!(value > smallest_pivot)) return false;
      row[i] = std::sqrt(value);
      log_det_ += std::log(value);
    }
  }
  return true;
}

// Each row of X is a combination of the rows above it; W is the sum of the rows' outer products.
void ScaledFactor::invert() {
  const std::size_t d = dimension_;
  for (std::size_t i = 0; i < d; ++i) {
    double* row = inverse_factor_.data() + i * d;
    std::fill_n(row, d, 0.0);
    for (std::size_t k = 0; k < i; ++k) {
      const double entry = factor_[i * d + k];
      const double* above = inverse_factor_.data() + k * d;
      for (std::size_t j = 0; j <= k; ++j) row[j] -= entry * above[j];
    }
    row[i] = scale_[i];
    const double pivot = 1.0 / factor_[i * d + i];
    for (std::size_t j = 0; j <= i; ++j) row[j] *= pivot;
  }
  std::ranges::fill(trace_dual_, 0.0);
  for (std::size_t k = 0; k < d; ++k) {
    const double* row = inverse_factor_.data() + k * d;
    for (std::size_t i = 0; i <= k; ++i) {
      double* out = trace_dual_.data() + packed_index(i, 0);
      const double twice = 2.0 * row[i];
      for (std::size_t j = 0; j < i; ++j) out[j] += twice * row[j];
      out[i] += row[i] * row[i];
    }
  }
}

}  // namespace graybox
