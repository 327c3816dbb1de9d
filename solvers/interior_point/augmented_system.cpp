#include "solvers/interior_point/augmented_system.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "problems/kernels/kernels.hpp"
#include "solvers/core/lapack.hpp"
#include "solvers/core/tiled_cholesky.hpp"

namespace graybox {
namespace {

double dot(const double* a, const double* b, std::size_t size) {
  double sum = 0.0;
  for (std::size_t k = 0; k < size; ++k) sum += a[k] * b[k];
  return sum;
}

}  // namespace

AugmentedSystem::AugmentedSystem(const NormalizedSet& normal, std::unique_ptr<RangeSystem> range,
                                 int threads)
    : normal_(normal),
      threads_(threads),
      range_(std::move(range)),
      scale_(symmetric_scale(normal.dimension())),
      row_squares_(normal.candidate_count()),
      ratios_(normal.candidate_count()),
      weights_(normal.candidate_count()),
      rows_(2 * normal.packed_size() * normal.packed_size()),
      columns_(rows_.size()),
      schur_(4 * normal.packed_size() * normal.packed_size()),
      kept_solution_(2 * normal.packed_size()),
      packed_(normal.packed_size()) {
  kept_back_.reserve(kept_solution_.size());
  for (std::size_t i = 0; i < row_squares_.size(); ++i) {
    const auto row = normal.row(i);
    for (std::size_t k = 0; k < row.size(); ++k) {
      row_squares_[i] += scale_[k] * scale_[k] * row[k] * row[k];
    }
  }
}

bool AugmentedSystem::factorise(const Eigen::MatrixXd& inverse_scaling,
                                std::span<const double> ratios) {
  std::ranges::copy(ratios, ratios_.begin());
  barrier_.noalias() = inverse_scaling.transpose() * inverse_scaling;
  choose_kept_back(barrier_.squaredNorm());
  std::ranges::copy(ratios, weights_.begin());
  for (const std::size_t i : kept_back_) weights_[i] = 0.0;
  return range_->factorise(inverse_scaling, weights_) && factorise_kept_back();
}

// B: D_i |a_i|^2 above 1e4 |N|, or above a higher power of ten if those are too many.
void AugmentedSystem::choose_kept_back(double barrier_norm) {
  for (double threshold = 1e4 * barrier_norm;; threshold *= 10.0) {
    kept_back_.clear();
    bool fits = true;
    for (std::size_t i = 0; i < ratios_.size() && fits; ++i) {
      if (!(ratios_[i] * row_squares_[i] > threshold)) continue;
      fits = kept_back_.size() < kept_solution_.size();
      if (fits) kept_back_.push_back(i);
    }
    if (fits) return;
    if (!std::isfinite(threshold)) {
      kept_back_.clear();
      return;
    }
  }
}

bool AugmentedSystem::factorise_kept_back() {
  const std::size_t p = normal_.packed_size(), size = kept_back_.size();
  if (size == 0) return true;
  for (std::size_t b = 0; b < size; ++b) {
    const auto row = normal_.row(kept_back_[b]);
    for (std::size_t k = 0; k < p; ++k) rows_[b * p + k] = scale_[k] * row[k];
  }
  std::copy_n(rows_.begin(), size * p, columns_.begin());
  range_->solve(columns_.span().first(size * p), size);
  for (std::size_t b = 0; b < size; ++b) {
    for (std::size_t c = b; c < size; ++c) {
      schur_[b * size + c] = dot(rows_.data() + b * p, columns_.data() + c * p, p);
    }
    schur_[b * size + b] += 1.0 / ratios_[kept_back_[b]];
  }
  return factorise_cholesky_tiled(size, schur_.data(), threads_);
}

void AugmentedSystem::solve(std::span<double> x, std::span<const double> t, std::span<double> y,
                            std::span<double> image) {
  const std::size_t p = normal_.packed_size(), count = normal_.candidate_count();
  for (std::size_t i = 0; i < count; ++i) weights_[i] = ratios_[i] * t[i];
  for (const std::size_t i : kept_back_) weights_[i] = 0.0;
  std::ranges::fill(packed_, 0.0);
  kernels().accumulate(normal_.rows(), count, p, weights_.data(), packed_.data());
  for (std::size_t k = 0; k < p; ++k) x[k] += scale_[k] * packed_[k];
  range_->solve(x, 1);
  solve_kept_back(x, t);

  for (std::size_t k = 0; k < p; ++k) packed_[k] = scale_[k] * x[k];
  kernels().price(normal_.rows(), count, p, packed_.data(), image.data());
  for (std::size_t i = 0; i < count; ++i) y[i] = ratios_[i] * (image[i] - t[i]);
  for (std::size_t b = 0; b < kept_back_.size(); ++b) {
    const std::size_t i = kept_back_[b];
    y[i] = kept_solution_[b];
    image[i] = t[i] + y[i] / ratios_[i];
  }
}

// y_B, and x without its share.
void AugmentedSystem::solve_kept_back(std::span<double> x, std::span<const double> t) {
  const std::size_t p = normal_.packed_size(), size = kept_back_.size();
  if (size == 0) return;
  for (std::size_t b = 0; b < size; ++b) {
    kept_solution_[b] = dot(rows_.data() + b * p, x.data(), p) - t[kept_back_[b]];
  }
  lapack::solve_cholesky(size, schur_.data(), 1, kept_solution_.data());
  for (std::size_t b = 0; b < size; ++b) {
    for (std::size_t k = 0; k < p; ++k) x[k] -= kept_solution_[b] * columns_[b * p + k];
  }
}

}  // namespace graybox
