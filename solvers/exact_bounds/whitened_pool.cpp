#include "solvers/exact_bounds/whitened_pool.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

using ExtendedMatrix = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <class Number>
void unpack_extended(std::span<const Number> packed, ExtendedMatrix& full) {
  const Eigen::Index d = full.rows();
  for (Eigen::Index i = 0, k = 0; i < d; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j, ++k) {
      full(i, j) = full(j, i) = packed[static_cast<std::size_t>(k)];
    }
  }
}

// X full X^T, rounded and packed into `row`; left in `full`.
void whiten(const Eigen::Map<const ExtendedMatrix>& transform, ExtendedMatrix& full,
            ExtendedMatrix& product, double* row) {
  product.noalias() = transform.triangularView<Eigen::Lower>() * full;
  full.noalias() = product * transform.transpose().triangularView<Eigen::Upper>();
  for (Eigen::Index i = 0; i < full.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) *row++ = static_cast<double>(full(i, j));
  }
}

}  // namespace

WhitenedPool::WhitenedPool(const InformationSet& set, const Relaxation& relaxation,
                           std::span<const std::size_t> candidates, int threads, StopClock clock)
    : dimension_(set.dimension()),
      packed_size_(set.packed_size()),
      candidates_(candidates.begin(), candidates.end()),
      rows_(candidates.size() * set.packed_size()),
      largest_rank_(relaxation.largest_rank) {
  const auto d = static_cast<Eigen::Index>(dimension_);
  const Eigen::Map<const ExtendedMatrix> transform(relaxation.inverse_factor.data(), d, d);
  Extended log_det = 0;
  for (Eigen::Index i = 0; i < d; ++i) log_det += std::log(transform(i, i));
  log_det_shift_ = static_cast<double>(-2 * log_det);

  const auto count = static_cast<std::ptrdiff_t>(size());
  std::vector<double> norms(size());
#pragma omp parallel num_threads(threads)
  {
    ExtendedMatrix full(d, d), product(d, d);
#pragma omp for schedule(static)
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      if (clock.stops()) continue;
      const auto at = static_cast<std::size_t>(k);
      unpack_extended(set.information(candidates_[at]), full);
      whiten(transform, full, product, rows_.data() + at * packed_size_);
      norms[at] = static_cast<double>(full.norm());
    }
  }
  if (clock.stops()) throw Stopped();
  for (const double norm : norms) largest_norm_ = std::max(largest_norm_, norm);
}

std::vector<double> whitened_sum(const InformationSet& set, const Relaxation& relaxation,
                                 std::span<const std::int64_t> counts) {
  std::vector<Extended> sum(set.packed_size(), 0);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    const auto row = set.information(i);
    for (std::size_t k = 0; k < sum.size(); ++k)
      sum[k] += static_cast<Extended>(counts[i]) * row[k];
  }
  const auto d = static_cast<Eigen::Index>(set.dimension());
  ExtendedMatrix full(d, d), product(d, d);
  unpack_extended(std::span<const Extended>(sum), full);
  std::vector<double> whitened(set.packed_size());
  whiten(Eigen::Map<const ExtendedMatrix>(relaxation.inverse_factor.data(), d, d), full, product,
         whitened.data());
  return whitened;
}

double WhitenedPool::sensitivity_rounding() const {
  const auto terms = static_cast<double>(packed_size_ + 4 * dimension_ + 32);
  return terms * 0.5 * std::numeric_limits<double>::epsilon() * largest_norm_;
}

}  // namespace graybox
