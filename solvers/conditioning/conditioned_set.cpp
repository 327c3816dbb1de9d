#include "solvers/conditioning/conditioned_set.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "problems/information/held_numbers.hpp"
#include "solvers/conditioning/twofold_congruence.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox {
namespace {

using Real = long double;

[[noreturn]] void refuse_singular(const InformationSet& set) {
  throw InputError(fmt::format(
      "{}: the sum of all information matrices is singular: no design estimates all {} parameters",
      set.name().empty() ? "information set" : set.name(), set.dimension()));
}

void require_finite(const InformationSet& set, std::span<const double> uniform) {
  if (std::ranges::all_of(uniform, [](double x) { return std::isfinite(x); })) return;
  std::vector<double> buffer(set.packed_size());
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    if (!std::ranges::all_of(set.packed(i, buffer), [](double x) { return std::isfinite(x); })) {
      throw InputError(fmt::format("{}: candidate {}: the information matrix is not finite",
                                   set.name().empty() ? "information set" : set.name(), i));
    }
  }
  throw InputError("information set: the sum of the information matrices overflows; rescale them");
}

// Ratio of the extreme eigenvalues after scaling to unit diagonal; infinity if not positive.
double scaled_condition(std::span<const double> packed, std::size_t d) {
  const auto size = static_cast<Eigen::Index>(d);
  Eigen::MatrixXd matrix(size, size);
  unpack(packed.data(), d, matrix.data());
  if (!(matrix.diagonal().minCoeff() > 0.0)) return std::numeric_limits<double>::infinity();
  const Eigen::VectorXd scale = matrix.diagonal().cwiseSqrt().cwiseInverse();
  matrix = scale.asDiagonal() * matrix * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix, Eigen::EigenvaluesOnly);
  const double smallest = eigen.eigenvalues()(0);
  if (!(smallest > 0.0)) return std::numeric_limits<double>::infinity();
  return eigen.eigenvalues()(size - 1) / smallest;
}

// As InformationSet::validate(): each candidate counts alike, so that few huge ones can't hide the
// directions that the others see, while rounding noise in a null space does not pass for
// information.
bool sum_is_singular(const InformationSet& set) {
  const std::size_t d = set.dimension();
  std::vector<double> sum(set.packed_size(), 0.0), buffer(set.packed_size());
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const auto h = set.packed(i, buffer);
    double scale = 0.0;
    for (std::size_t j = 0; j < d; ++j) scale = std::max(scale, h[packed_index(j, j)]);
    if (!(scale > 0.0)) continue;
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += h[k] / scale;
  }
  return !(scaled_condition(sum, d) < 1e14 / static_cast<double>(d));
}

// The information matrix of the uniform design, packed.
std::vector<Real> uniform_mean(const InformationSet& set) {
  std::vector<Real> mean = extended_sum(set);
  for (Real& x : mean) x /= static_cast<Real>(set.candidate_count());
  return mean;
}

// R = L^-1 with packed = L L^T; lower triangle, full row-major. False if a pivot, relative to unit
// diagonal, is at rounding level.
bool inverse_factor(const std::vector<Real>& packed, std::size_t d, std::vector<Real>& inverse) {
  std::vector<Real> factor(packed);
  inverse.assign(d * d, 0);
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      Real value = packed[packed_index(i, j)];
      for (std::size_t k = 0; k < j; ++k) {
        value -= factor[packed_index(i, k)] * factor[packed_index(j, k)];
      }
      if (i > j) {
        factor[packed_index(i, j)] = value / factor[packed_index(j, j)];
        continue;
      }
      const Real unit = std::numeric_limits<Real>::epsilon();
      if (!(value > 8 * static_cast<Real>(d) * unit * packed[packed_index(i, i)])) return false;
      factor[packed_index(i, i)] = std::sqrt(value);
    }
  }
  for (std::size_t j = 0; j < d; ++j) {
    for (std::size_t i = j; i < d; ++i) {
      Real value = i == j ? 1 : 0;
      for (std::size_t k = j; k < i; ++k) value -= factor[packed_index(i, k)] * inverse[k * d + j];
      inverse[i * d + j] = value / factor[packed_index(i, i)];
    }
  }
  return true;
}

}  // namespace

std::vector<long double> extended_sum(const InformationSet& set) {
  const std::size_t d = set.dimension(), count = set.candidate_count();
  std::vector<Real> sum(set.packed_size(), 0);
  for (std::size_t i = 0; i < count; ++i) {
    if (!set.has_factors()) {
      const auto h = set.information(i);
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += h[k];
      continue;
    }
    const auto factor = set.factor(i);
    for (std::size_t from = 0; from < factor.size(); from += d) {
      for (std::size_t j = 0, k = 0; j < d; ++j) {
        const Real entry = factor[from + j];
        for (std::size_t l = 0; l <= j; ++l, ++k) sum[k] += entry * factor[from + l];
      }
    }
  }
  return sum;
}

std::optional<InformationSet> in_coordinates(const InformationSet& set, std::span<const double> r,
                                             int threads) {
  const std::size_t d = set.dimension(), count = set.candidate_count();
  const std::span<const double> numbers = held_numbers(set);
  AlignedArray copy(numbers.size());
  const bool done =
      set.has_factors()
          ? twofold_product(numbers.data(), count * set.rank(), d, r, copy.data(), threads)
          : twofold_congruence(numbers.data(), count, d, r, copy.data(), threads);
  if (!done) return std::nullopt;
  return of_same_form(set, std::move(copy));
}

ConditionedSet::ConditionedSet(const InformationSet& set, double accuracy, Tracer& tracer,
                               int threads)
    : original_(set), uniform_(set.packed_size()) {
  const double count = static_cast<double>(set.candidate_count());
  const std::vector<double> weights(set.candidate_count(), 1.0 / count);
  information_matrix(set, weights, uniform_);
  tracer.count_passes(1.0);
  require_finite(set, uniform_);
  const double d = static_cast<double>(set.dimension());
  const double condition = scaled_condition(uniform_, set.dimension());
  if (d * std::numeric_limits<double>::epsilon() * condition > accuracy) {
    if (sum_is_singular(set)) refuse_singular(set);
    whiten(threads);
    tracer.count_passes(3.0);
  }
}

void ConditionedSet::whiten(int threads) {
  const std::size_t d = original_.dimension();
  const std::size_t count = original_.candidate_count();
  std::vector<Real> r;
  if (!inverse_factor(uniform_mean(original_), d, r)) refuse_singular(original_);
  coordinates_.assign(r.begin(), r.end());
  copy_ = in_coordinates(original_, coordinates_, threads);
  if (!copy_) return coordinates_.clear();  // the caller has no time for more
  const std::vector<double> weights(count, 1.0 / static_cast<double>(count));
  information_matrix(*copy_, weights, uniform_);
  // The identity, unless the spread is beyond what extended precision bears.
  if (!(scaled_condition(uniform_, d) < 1e6)) refuse_singular(original_);
}

}  // namespace graybox
