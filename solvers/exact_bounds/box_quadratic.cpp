#include "solvers/exact_bounds/box_quadratic.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {

void BoxQuadratic::reserve(std::size_t variables) {
  if (place_.size() >= variables) return;
  place_.resize(variables);
  free_.reserve(variables);
  block_.resize(variables * variables);
  target_.resize(variables);
  ones_.resize(variables);
}

bool BoxQuadratic::solve_free(std::span<const double> matrix, std::span<const double> linear,
                              std::span<const double> y) {
  const std::size_t n = y.size(), f = free_.size();
  double trace = 0.0, fixed_sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    if (place_[i] != Place::kFree) fixed_sum += y[i];
  }
  for (std::size_t b = 0; b < f; ++b) {
    const std::size_t j = free_[b];
    for (std::size_t a = b; a < f; ++a) block_[b * f + a] = matrix[j * n + free_[a]];
    trace += block_[b * f + b];
    double value = linear[j];
    for (std::size_t i = 0; i < n; ++i) {
      if (place_[i] != Place::kFree && y[i] != 0.0) value -= entry(matrix, n, i, j) * y[i];
    }
    target_[b] = value;
    ones_[b] = 1.0;
  }
  const double smallest = trace * std::numeric_limits<double>::epsilon() * 1e-2;
  if (!dense_kernels().cholesky(block_.data(), f, smallest)) return false;
  dense_kernels().cholesky_solve(block_.data(), f, target_.data());
  dense_kernels().cholesky_solve(block_.data(), f, ones_.data());
  double target_sum = 0.0, ones_sum = 0.0;
  for (std::size_t b = 0; b < f; ++b) {
    target_sum += target_[b];
    ones_sum += ones_[b];
  }
  multiplier_ = (target_sum + fixed_sum) / ones_sum;
  for (std::size_t b = 0; b < f; ++b) target_[b] -= multiplier_ * ones_[b];
  return true;
}

double BoxQuadratic::gradient(std::span<const double> matrix, std::span<const double> linear,
                              std::span<const double> y, std::size_t i) const {
  double value = linear[i];
  for (std::size_t j = 0; j < y.size(); ++j) {
    if (y[j] != 0.0) value -= entry(matrix, y.size(), i, j) * y[j];
  }
  return value;
}

void BoxQuadratic::set_free(std::size_t i) {
  place_[i] = Place::kFree;
  free_.insert(std::ranges::lower_bound(free_, i), i);
}

bool BoxQuadratic::release(std::span<const double> matrix, std::span<const double> linear,
                           std::span<const double> y) {
  constexpr double kTolerance = 1e-12;
  const std::size_t n = y.size();
  std::size_t rising = n, falling = n;  // the bound variables that gain most by moving
  double largest = 0.0, smallest = 0.0, scale = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    if (place_[i] != Place::kLower && place_[i] != Place::kUpper) continue;
    const double value = gradient(matrix, linear, y, i);
    scale = std::max(scale, std::abs(linear[i]));
    if (place_[i] == Place::kLower && (rising == n || value > largest)) {
      rising = i;
      largest = value;
    }
    if (place_[i] == Place::kUpper && (falling == n || value < smallest)) {
      falling = i;
      smallest = value;
    }
  }
  if (free_.empty()) {
    if (rising == n || falling == n || !(largest - smallest > kTolerance * scale)) return false;
    set_free(rising);
    set_free(falling);
    return true;
  }
  const double up = rising == n ? 0.0 : largest - multiplier_;
  const double down = falling == n ? 0.0 : multiplier_ - smallest;
  if (!(std::max(up, down) > kTolerance * scale)) return false;
  set_free(up >= down ? rising : falling);
  return true;
}

bool BoxQuadratic::solve(std::span<const double> matrix, std::span<const double> linear,
                         std::span<const double> lower, std::span<const double> upper,
                         std::span<double> y) {
  const std::size_t n = y.size();
  reserve(n);
  std::ranges::fill(y, 0.0);
  free_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    place_[i] = upper[i] > lower[i] ? Place::kFree : Place::kFixed;
    if (place_[i] == Place::kFree) free_.push_back(i);
  }
  const std::size_t pivot_limit = 4 * n + 20;
  for (std::size_t pivot = 0; pivot < pivot_limit; ++pivot) {
    if (free_.empty()) {
      if (!release(matrix, linear, y)) return true;
      continue;
    }
    if (!solve_free(matrix, linear, y)) return false;
    double step = 1.0;
    std::size_t blocking = n;
    for (std::size_t b = 0; b < free_.size(); ++b) {
      const std::size_t i = free_[b];
      const double limit = target_[b] < lower[i] ? lower[i] : upper[i];
      if (target_[b] >= lower[i] && target_[b] <= upper[i]) continue;
      const double reach = (limit - y[i]) / (target_[b] - y[i]);
      if (reach < step) {
        step = std::max(reach, 0.0);
        blocking = i;
      }
    }
    for (std::size_t b = 0; b < free_.size(); ++b) {
      const std::size_t i = free_[b];
      y[i] += step * (target_[b] - y[i]);
    }
    if (blocking < n) {
      const bool low = y[blocking] - lower[blocking] <= upper[blocking] - y[blocking];
      y[blocking] = low ? lower[blocking] : upper[blocking];
      place_[blocking] = low ? Place::kLower : Place::kUpper;
      std::erase(free_, blocking);
      continue;
    }
    if (!release(matrix, linear, y)) return true;
  }
  return true;
}

}  // namespace graybox
