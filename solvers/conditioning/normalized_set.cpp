#include "solvers/conditioning/normalized_set.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/core/lapack.hpp"
#include "solvers/kernels/gram_kernels.hpp"

namespace graybox {
namespace {

// out = X H X^T in extended precision; product: d x d scratch.
void congruence_extended(const double* h, std::size_t d, const double* x, double* out,
                         std::vector<long double>& product) {
  for (std::size_t a = 0; a < d; ++a) {
    for (std::size_t j = 0; j < d; ++j) {
      long double sum = 0;
      for (std::size_t k = 0; k <= a; ++k) {
        sum += static_cast<long double>(x[packed_index(a, k)]) * h[packed_index(k, j)];
      }
      product[a * d + j] = sum;
    }
  }
  for (std::size_t a = 0, k = 0; a < d; ++a) {
    for (std::size_t b = 0; b <= a; ++b, ++k) {
      long double sum = 0;
      for (std::size_t j = 0; j <= b; ++j) sum += product[a * d + j] * x[packed_index(b, j)];
      out[k] = static_cast<double>(sum);
    }
  }
}

double frobenius_norm(std::span<const double> packed, std::size_t d) {
  double squares = 0.0;
  for (std::size_t i = 0, k = 0; i < d; ++i) {
    for (std::size_t j = 0; j < i; ++j, ++k) squares += 2.0 * packed[k] * packed[k];
    squares += packed[k] * packed[k];
    ++k;
  }
  return std::sqrt(squares);
}

}  // namespace

NormalizedSet::NormalizedSet(const InformationSet& set, const NormalizedSetOptions& options)
    : candidate_count_(set.candidate_count()),
      dimension_(set.dimension()),
      packed_size_(set.packed_size()),
      rows_(candidate_count_ * packed_size_),
      row_norms_(candidate_count_, 1.0),
      transform_(packed_size_, 0.0) {
  lapack::require_room(1);  // here, and for what solves with these rows
  for (std::size_t i = 0; i < dimension_; ++i) transform_[packed_index(i, i)] = 1.0;
  if (!options.whiten) {
    std::copy(set.data(), set.data() + rows_.size(), rows_.begin());
    passes_ += 1.0;
  } else if (choose_transform(set, options.accuracy)) {
    transform_rows(set, options.threads);
    if (stop_requested()) {
      message_ = "time was up before the candidates were whitened";
      return;
    }
  } else {
    message_ = "the mean information matrix is singular: no design can estimate all parameters";
    return;
  }
  if (options.scale_rows) scale_rows();
}

// X = L^-1 by way of the mean scaled to unit diagonal, S Mbar S = R R^T: X = R^-1 S.
bool NormalizedSet::choose_transform(const InformationSet& set, double accuracy) {
  const std::size_t d = dimension_;
  std::vector<double> mean(packed_size_, 0.0);
  const std::vector<double> equal(candidate_count_, 1.0 / static_cast<double>(candidate_count_));
  kernels().accumulate(set.data(), candidate_count_, packed_size_, equal.data(), mean.data());
  passes_ += 1.0;

  std::vector<double> scale(d), full(d * d);
  for (std::size_t i = 0; i < d; ++i) {
    const double diagonal = mean[packed_index(i, i)];
    if (!(diagonal > 0.0) || !std::isfinite(diagonal)) return false;
    scale[i] = 1.0 / std::sqrt(diagonal);
  }
  unpack(mean.data(), d, full.data());
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j < d; ++j) full[i * d + j] *= scale[i] * scale[j];
  }
  if (!lapack::factorise_cholesky(d, full.data())) return false;
  double smallest = 1.0;
  for (std::size_t i = 0; i < d; ++i) smallest = std::min(smallest, full[i * d + i]);
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  if (!(smallest * smallest > 4.0 * static_cast<double>(d) * kEpsilon)) return false;

  lapack::invert_lower(d, full.data());
  // tr(S^-1) is the squared norm of R^-1, the lower triangle of a column-major square.
  double trace = 0.0;
  for (std::size_t j = 0; j < d; ++j) {
    for (std::size_t i = j; i < d; ++i) trace += full[j * d + i] * full[j * d + i];
  }
  const double in_double = static_cast<double>(d) * kEpsilon * trace;
  ill_conditioned_ = smallest < 1e-4 || in_double > accuracy;
  rounding_ = ill_conditioned_ ? kEpsilon + in_double / 2048.0 : in_double;
  for (std::size_t i = 0, k = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j, ++k) transform_[k] = full[j * d + i] * scale[j];
    log_det_shift_ -= 2.0 * std::log(transform_[k - 1]);
  }
  return true;
}

void NormalizedSet::transform_rows(const InformationSet& set, int threads) {
  const std::size_t d = dimension_, p = packed_size_;
  constexpr std::size_t kChunk = 256;
  const std::size_t chunks = (candidate_count_ + kChunk - 1) / kChunk;
  const StopClock clock;
#pragma omp parallel num_threads(threads) if (threads > 1)
  {
    std::vector<double> workspace(congruence_workspace_size(d));
    std::vector<long double> product(ill_conditioned_ ? d * d : 0);
#pragma omp for schedule(static)
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
      if (clock.stops()) continue;
      const std::size_t begin = chunk * kChunk;
      const std::size_t size = std::min(kChunk, candidate_count_ - begin);
      if (!ill_conditioned_) {
        gram_kernels().congruence(set.data() + begin * p, size, d, transform_.data(),
                                  rows_.data() + begin * p, workspace.data());
        continue;
      }
      for (std::size_t i = begin; i < begin + size && !clock.stops(); ++i) {
        congruence_extended(set.data() + i * p, d, transform_.data(), rows_.data() + i * p,
                            product);
      }
    }
  }
  passes_ += 1.0;
}

void NormalizedSet::scale_rows() {
  const std::size_t p = packed_size_;
  for (std::size_t i = 0; i < candidate_count_; ++i) {
    const double norm = frobenius_norm(row(i), dimension_);
    if (!(norm > 0.0)) continue;
    row_norms_[i] = norm;
    const double factor = 1.0 / norm;
    for (std::size_t k = 0; k < p; ++k) rows_[i * p + k] *= factor;
  }
  passes_ += 1.0;
}

void NormalizedSet::weights_from_multipliers(std::span<const double> multipliers,
                                             std::span<double> weights) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < candidate_count_; ++i) {
    weights[i] = multipliers[i] / row_norms_[i];
    sum += weights[i];
  }
  for (double& weight : weights) weight /= sum;
}

}  // namespace graybox
