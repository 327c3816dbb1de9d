#include "graybox/solvers/extended_information.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "graybox/problems/packed_matrix.hpp"

namespace graybox {
namespace {

constexpr Extended kUnit = std::numeric_limits<Extended>::epsilon() / 2;

// A dense lower triangle or square of extended numbers, row-major.
using Matrix = std::vector<Extended>;

// M = sum_i weights_i H_i over the support, packed.
Matrix weighted_sum(const InformationSet& set, std::span<const Extended> weights) {
  const std::size_t p = set.packed_size();
  Matrix sum(p, 0);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] == 0) continue;
    const auto h = set.information(i);
    for (std::size_t k = 0; k < p; ++k) sum[k] += weights[i] * h[k];
  }
  return sum;
}

// Packed Cholesky factor L of the packed matrix scaled to unit diagonal; the logarithms of the
// pivots of the matrix itself.
bool factorise(const Matrix& packed, const std::vector<Extended>& scale, std::size_t d,
               Matrix& factor, std::vector<Extended>& log_pivots) {
  factor = packed;
  log_pivots.resize(d);
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      Extended value = packed[packed_index(i, j)] * scale[i] * scale[j];
      for (std::size_t k = 0; k < j; ++k) {
        value -= factor[packed_index(i, k)] * factor[packed_index(j, k)];
      }
      if (i == j) {
        // The factor of a matrix of unit diagonal: a pivot at rounding level means singular.
        if (!(value > 8 * static_cast<Extended>(d) * kUnit)) return false;
        factor[packed_index(i, i)] = std::sqrt(value);
        log_pivots[i] = std::log(value) - 2 * std::log(scale[i]);
      } else {
        factor[packed_index(i, j)] = value / factor[packed_index(j, j)];
      }
    }
  }
  return true;
}

// Inverse X = L^-1 S of the scaled factor, packed lower triangle: X M X^T = I up to rounding.
Matrix invert_factor(const Matrix& factor, const std::vector<Extended>& scale, std::size_t d) {
  Matrix inverse(factor.size(), 0);
  for (std::size_t j = 0; j < d; ++j) {
    for (std::size_t i = j; i < d; ++i) {
      Extended value = i == j ? Extended{1} : Extended{0};
      for (std::size_t k = j; k < i; ++k) {
        value -= factor[packed_index(i, k)] * inverse[packed_index(k, j)];
      }
      inverse[packed_index(i, j)] = value / factor[packed_index(i, i)];
    }
  }
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) inverse[packed_index(i, j)] *= scale[j];
  }
  return inverse;
}

// A bound on the spectral norm of X M X^T - I for the exact M of the (exact, renormalised) weights:
// the Frobenius norm of the residual as computed, plus what rounding can have added to it and to M.
// Each product chain has at most 2 d terms, and each entry of M a chain of `support` terms; for
// positive semidefinite H_i, sum_i lambda_i |H_i|_jk <= sqrt(M_jj M_kk).
Extended inverse_residual(const Matrix& inverse, const Matrix& packed, std::size_t d,
                          std::size_t support) {
  Matrix product(d * d, 0), magnitude(d * d, 0);  // X M and |X| diag-bound of |M|
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t k = 0; k < d; ++k) {
      for (std::size_t j = 0; j <= i; ++j) {
        const Extended x = inverse[packed_index(i, j)];
        product[i * d + k] += x * packed[packed_index(j, k)];
        magnitude[i * d + k] += std::abs(x) * std::sqrt(packed[packed_index(j, j)]) *
                                std::sqrt(packed[packed_index(k, k)]);
      }
    }
  }
  Extended residual = 0, rounding = 0;
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j < d; ++j) {
      Extended entry = i == j ? Extended{-1} : Extended{0}, bound = 0;
      for (std::size_t k = 0; k <= j; ++k) {
        entry += product[i * d + k] * inverse[packed_index(j, k)];
        bound += magnitude[i * d + k] * std::abs(inverse[packed_index(j, k)]);
      }
      residual += entry * entry;
      rounding += bound * bound;
    }
  }
  const Extended chain = static_cast<Extended>(2 * d + support + 8);
  return std::sqrt(residual) + chain * kUnit * std::sqrt(rounding);
}

// W = X^T X in trace-dual packing.
Matrix trace_dual(const Matrix& inverse, std::size_t d) {
  Matrix dual(inverse.size(), 0);
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      Extended value = 0;
      for (std::size_t k = i; k < d; ++k) {
        value += inverse[packed_index(k, i)] * inverse[packed_index(k, j)];
      }
      dual[packed_index(i, j)] = i == j ? value : 2 * value;
    }
  }
  return dual;
}

// The packed matrix with rows and columns in another order.
Matrix reordered(const Matrix& packed, std::span<const std::size_t> order) {
  Matrix out(packed.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      out[packed_index(i, j)] = packed[packed_index(order[i], order[j])];
    }
  }
  return out;
}

}  // namespace

CheckedWeights::CheckedWeights(const InformationSet& set, const Design& design) {
  const std::size_t count = set.candidate_count();
  if (design.weights.size() != count) {
    message = fmt::format("the design has {} weights, the set {} candidates", design.weights.size(),
                          count);
    return;
  }
  Extended raw_sum = 0, kept_sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double weight = design.weights[i];
    if (!std::isfinite(weight) || weight < -1e-12) {
      message = fmt::format("weight {} is {}; weights must not be negative", i, weight);
      return;
    }
    raw_sum += weight;
    if (weight > 0.0) {
      kept_sum += weight;
      ++support_size;
    } else {
      clipped -= weight;
    }
  }
  renormalised = static_cast<double>(raw_sum - 1);
  if (std::abs(raw_sum - 1) > Extended{1e-9}) {
    message = fmt::format("the weights sum to {:.12g}, not 1", static_cast<double>(raw_sum));
    return;
  }
  weights.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    weights[i] = design.weights[i] > 0.0 ? Extended{design.weights[i]} / kept_sum : Extended{0};
  }
}

ExtendedInformation::ExtendedInformation(const InformationSet& set,
                                         std::span<const Extended> weights,
                                         std::span<const std::size_t> order)
    : dimension_(set.dimension()) {
  const std::size_t d = dimension_;
  std::vector<std::size_t> place(order.begin(), order.end());
  if (place.empty()) {
    place.resize(d);
    std::iota(place.begin(), place.end(), std::size_t{0});
  }
  const Matrix information = reordered(weighted_sum(set, weights), place);
  std::vector<Extended> scale(d);
  for (std::size_t i = 0; i < d; ++i) {
    const Extended diagonal = information[packed_index(i, i)];
    if (!(diagonal > 0)) return;
    scale[i] = 1 / std::sqrt(diagonal);
  }
  Matrix factor;
  if (!factorise(information, scale, d, factor, log_pivots_)) return;
  log_det_ = std::accumulate(log_pivots_.begin(), log_pivots_.end(), Extended{0});
  const Matrix inverse = invert_factor(factor, scale, d);
  const auto support = std::ranges::count_if(weights, [](Extended w) { return w > 0; });
  residual_ = inverse_residual(inverse, information, d, static_cast<std::size_t>(support));
  const Matrix dual = trace_dual(inverse, d);
  dual_.resize(dual.size());
  inverse_.assign(d * d, 0);
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      dual_[packed_index(place[i], place[j])] = dual[packed_index(i, j)];
      inverse_[i * d + place[j]] = inverse[packed_index(i, j)];
    }
  }
}

// Four chains hide the latency of extended additions.
Extended ExtendedInformation::sensitivity(std::span<const double> packed) const {
  Extended part[4] = {0, 0, 0, 0};
  std::size_t k = 0;
  for (; k + 4 <= packed.size(); k += 4) {
    for (std::size_t j = 0; j < 4; ++j) part[j] += dual_[k + j] * packed[k + j];
  }
  for (; k < packed.size(); ++k) part[0] += dual_[k] * packed[k];
  return (part[0] + part[1]) + (part[2] + part[3]);
}

Extended ExtendedInformation::magnitude(std::span<const double> packed) const {
  Extended sum = 0;
  for (std::size_t k = 0; k < packed.size(); ++k) sum += std::abs(dual_[k] * packed[k]);
  return sum;
}

Extended ExtendedInformation::trace_unit() const {
  return static_cast<Extended>(dual_.size() + 2 * dimension_ + 4) * kUnit;
}

}  // namespace graybox
