#include "solvers/restricted_problem/nonnegative_quadratic.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/base/stop.hpp"
#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {

void NonnegativeQuadratic::reserve(std::size_t variables) {
  if (is_free_.size() >= variables) return;
  free_.reserve(variables);
  is_free_.resize(variables);
  block_ = AlignedArray(variables * variables);
  value_.resize(variables);
  gradient_.resize(variables);
  spread_.resize(variables);
  wrong_.reserve(variables);
}

// Gathers and factors the free block, and solves for the free variables.
bool NonnegativeQuadratic::solve_free_block(std::span<const double> matrix,
                                            std::span<const double> linear) {
  const std::size_t n = linear.size();
  const std::size_t f = free_.size();
  double trace = 0.0;
  for (std::size_t b = 0; b < f; ++b) {
    const double* column = matrix.data() + free_[b] * n;
    for (std::size_t a = b; a < f; ++a) block_[b * f + a] = column[free_[a]];
    value_[b] = linear[free_[b]];
    trace += block_[b * f + b];
  }
  const double smallest = trace * std::numeric_limits<double>::epsilon() * 1e-2;
  if (!dense_kernels().cholesky(block_.data(), f, smallest)) return false;
  dense_kernels().cholesky_solve(block_.data(), f, value_.data());
  return true;
}

// Free variables below zero and bound variables whose gradient points inwards.
std::size_t NonnegativeQuadratic::find_wrong_signs(std::span<const double> matrix,
                                                   std::span<const double> linear,
                                                   double tolerance) {
  const std::size_t n = linear.size();
  std::ranges::copy(linear, gradient_.begin());
  std::fill_n(spread_.begin(), n, 0.0);
  for (std::size_t b = 0; b < free_.size(); ++b) spread_[free_[b]] = value_[b];
  dense_kernels().subtract_product(matrix.data(), n, spread_.data(), gradient_.data());
  wrong_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    if (is_free_[i] ? spread_[i] < 0.0 : gradient_[i] > tolerance) wrong_.push_back(i);
  }
  return wrong_.size();
}

bool NonnegativeQuadratic::solve(std::span<const double> matrix, std::span<const double> linear,
                                 std::span<double> mu) {
  const std::size_t n = linear.size();
  reserve(n);
  double scale = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    is_free_[i] = mu[i] > 0.0;
    scale = std::max(scale, std::abs(linear[i]));
  }
  const double tolerance = 1e-13 * scale;
  std::size_t fewest = n + 1;
  int chances = 3;
  const std::size_t pivot_limit = 30 + n / 4;
  for (std::size_t pivot = 0; pivot < pivot_limit; ++pivot) {
    free_.clear();
    for (std::size_t i = 0; i < n; ++i) {
      if (is_free_[i]) free_.push_back(i);
    }
    if (stop_requested() || !solve_free_block(matrix, linear)) return false;
    const std::size_t wrong = find_wrong_signs(matrix, linear, tolerance);
    if (wrong == 0) {
      for (std::size_t i = 0; i < n; ++i) mu[i] = is_free_[i] ? spread_[i] : 0.0;
      return true;
    }
    if (wrong < fewest) {
      fewest = wrong;
      chances = 3;
    } else if (--chances < 0) {
      const std::size_t last = *std::ranges::max_element(wrong_);
      wrong_.assign(1, last);
    }
    for (const std::size_t i : wrong_) is_free_[i] = !is_free_[i];
  }
  return false;
}

}  // namespace graybox
