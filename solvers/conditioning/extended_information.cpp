#include "solvers/conditioning/extended_information.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "problems/base/packed_matrix.hpp"
#include "solvers/conditioning/quadruple.hpp"

namespace graybox {
namespace {

template <class Real>
Real unit() {
  return std::numeric_limits<Real>::epsilon() / 2;
}

// A dense lower triangle or square, row-major.
template <class Real>
using Matrix = std::vector<Real>;

// sum += weight F^T F.
template <class Real>
void add_squares(const Real& weight, std::span<const double> factor, std::size_t d,
                 Matrix<Real>& sum) {
  for (std::size_t from = 0; from < factor.size(); from += d) {
    for (std::size_t j = 0, k = 0; j < d; ++j) {
      const Real scaled = weight * factor[from + j];
      for (std::size_t l = 0; l <= j; ++l, ++k) sum[k] += scaled * factor[from + l];
    }
  }
}

// M = sum_i weights_i H_i over the support, packed.
template <class Real>
Matrix<Real> weighted_sum(const InformationSet& set, std::span<const Extended> weights) {
  const std::size_t p = set.packed_size();
  Matrix<Real> sum(p, Real(0));
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] == 0) continue;
    const Real weight(weights[i]);
    if (set.has_factors()) {
      add_squares(weight, set.factor(i), set.dimension(), sum);
      continue;
    }
    const auto h = set.information(i);
    for (std::size_t k = 0; k < p; ++k) sum[k] += weight * h[k];
  }
  return sum;
}

// Packed Cholesky factor L of the packed matrix scaled to unit diagonal; the logarithms of the
// pivots of the matrix itself.
template <class Real>
bool factorise(const Matrix<Real>& packed, const std::vector<Real>& scale, std::size_t d,
               Matrix<Real>& factor, std::vector<Real>& log_pivots) {
  using std::log, std::sqrt;
  factor = packed;
  log_pivots.resize(d);
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      Real value = packed[packed_index(i, j)] * scale[i] * scale[j];
      for (std::size_t k = 0; k < j; ++k) {
        value -= factor[packed_index(i, k)] * factor[packed_index(j, k)];
      }
      if (i == j) {
        // The factor of a matrix of unit diagonal: a pivot at rounding level means singular.
        if (!(value > 8 * static_cast<Real>(d) * unit<Real>())) return false;
        factor[packed_index(i, i)] = sqrt(value);
        log_pivots[i] = log(value) - 2 * log(scale[i]);
      } else {
        factor[packed_index(i, j)] = value / factor[packed_index(j, j)];
      }
    }
  }
  return true;
}

// Inverse X = L^-1 S of the scaled factor, packed lower triangle: X M X^T = I up to rounding.
template <class Real>
Matrix<Real> invert_factor(const Matrix<Real>& factor, const std::vector<Real>& scale,
                           std::size_t d) {
  Matrix<Real> inverse(factor.size(), Real(0));
  for (std::size_t j = 0; j < d; ++j) {
    for (std::size_t i = j; i < d; ++i) {
      Real value = i == j ? Real(1) : Real(0);
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
template <class Real>
Real inverse_residual(const Matrix<Real>& inverse, const Matrix<Real>& packed, std::size_t d,
                      std::size_t support) {
  using std::abs, std::sqrt;
  Matrix<Real> product(d * d, Real(0)), magnitude(d * d, Real(0));  // X M and |X| diag-bound of |M|
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t k = 0; k < d; ++k) {
      for (std::size_t j = 0; j <= i; ++j) {
        const Real x = inverse[packed_index(i, j)];
        product[i * d + k] += x * packed[packed_index(j, k)];
        magnitude[i * d + k] +=
            abs(x) * sqrt(packed[packed_index(j, j)]) * sqrt(packed[packed_index(k, k)]);
      }
    }
  }
  Real residual = 0, rounding = 0;
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j < d; ++j) {
      Real entry = i == j ? Real(-1) : Real(0), bound = 0;
      for (std::size_t k = 0; k <= j; ++k) {
        entry += product[i * d + k] * inverse[packed_index(j, k)];
        bound += magnitude[i * d + k] * abs(inverse[packed_index(j, k)]);
      }
      residual += entry * entry;
      rounding += bound * bound;
    }
  }
  const Real chain = static_cast<Real>(2 * d + support + 8);
  // The weights were normalised in Extended: common and separate factors of M near one.
  const Real weights = static_cast<Real>(support + 2) * Real(unit<Extended>());
  return sqrt(residual) + chain * unit<Real>() * sqrt(rounding) + weights;
}

// W = X^T X in trace-dual packing.
template <class Real>
Matrix<Real> trace_dual(const Matrix<Real>& inverse, std::size_t d) {
  Matrix<Real> dual(inverse.size(), Real(0));
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      Real value = 0;
      for (std::size_t k = i; k < d; ++k) {
        value += inverse[packed_index(k, i)] * inverse[packed_index(k, j)];
      }
      dual[packed_index(i, j)] = i == j ? value : 2 * value;
    }
  }
  return dual;
}

// The packed matrix with rows and columns in another order.
template <class Real>
Matrix<Real> reordered(const Matrix<Real>& packed, std::span<const std::size_t> order) {
  Matrix<Real> out(packed.size());
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

template <class Real>
InformationIn<Real>::InformationIn(const InformationSet& set, std::span<const Extended> weights,
                                   std::span<const std::size_t> order)
    : dimension_(set.dimension()) {
  using std::sqrt;
  const std::size_t d = dimension_;
  std::vector<std::size_t> place(order.begin(), order.end());
  if (place.empty()) {
    place.resize(d);
    std::iota(place.begin(), place.end(), std::size_t{0});
  }
  const Matrix<Real> information = reordered(weighted_sum<Real>(set, weights), place);
  std::vector<Real> scale(d);
  for (std::size_t i = 0; i < d; ++i) {
    const Real diagonal = information[packed_index(i, i)];
    if (!(diagonal > 0)) return;
    scale[i] = 1 / sqrt(diagonal);
  }
  Matrix<Real> factor;
  if (!factorise(information, scale, d, factor, log_pivots_)) return;
  log_det_ = std::accumulate(log_pivots_.begin(), log_pivots_.end(), Real(0));
  const Matrix<Real> inverse = invert_factor(factor, scale, d);
  const auto support = std::ranges::count_if(weights, [](Extended w) { return w > 0; });
  triangular_ = order.empty();
  // Of factors, each term of M has k products of three numbers.
  const std::size_t terms =
      std::max<std::size_t>(1, set.rank()) * static_cast<std::size_t>(support);
  residual_ = inverse_residual(inverse, information, d, terms);
  const Matrix<Real> dual = trace_dual(inverse, d);
  dual_.resize(dual.size());
  diagonal_.resize(d);
  inverse_.assign(d * d, Real(0));
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      dual_[packed_index(place[i], place[j])] = dual[packed_index(i, j)];
      inverse_[i * d + place[j]] = inverse[packed_index(i, j)];
    }
    diagonal_[place[i]] = static_cast<double>(dual[packed_index(i, i)]);
  }
}

// Four chains hide the latency of extended additions.
template <class Real>
Real InformationIn<Real>::sensitivity(std::span<const double> packed) const {
  Real part[4] = {0, 0, 0, 0};
  std::size_t k = 0;
  for (; k + 4 <= packed.size(); k += 4) {
    for (std::size_t j = 0; j < 4; ++j) part[j] += dual_[k + j] * packed[k + j];
  }
  for (; k < packed.size(); ++k) part[0] += dual_[k] * packed[k];
  return (part[0] + part[1]) + (part[2] + part[3]);
}

template <class Real>
Real InformationIn<Real>::magnitude(std::span<const double> packed) const {
  using std::abs;
  Real sum = 0;
  for (std::size_t k = 0; k < packed.size(); ++k) sum += abs(dual_[k] * packed[k]);
  return sum;
}

template <class Real>
double InformationIn<Real>::largest_magnitude(std::span<const double> packed) const {
  double sum = 0.0;
  for (std::size_t a = 0, k = 0; a < dimension_; ++a, k += a + 1) {
    sum += static_cast<double>(dual_[k]) * packed[k];
  }
  return 1.001 * static_cast<double>(dimension_) * sum;
}

template <class Real>
Real InformationIn<Real>::trace_unit() const {
  return static_cast<Real>(dual_.size() + 2 * dimension_ + 4) * unit<Real>();
}

// Four rows of X at a time: their chains hide the latency of extended additions.
template <class Real>
Real InformationIn<Real>::sensitivity(const InformationSet& set, std::size_t candidate) const {
  if (!set.has_factors()) return sensitivity(set.information(candidate));
  const std::size_t d = dimension_;
  const auto factor = set.factor(candidate);
  Real total = 0;
  for (std::size_t from = 0; from < factor.size(); from += d) {
    const double* f = factor.data() + from;
    for (std::size_t j = 0; j < d; j += 4) {
      const std::size_t rows = std::min<std::size_t>(4, d - j);
      const std::size_t columns = triangular_ ? j + rows : d;
      Real y[4] = {0, 0, 0, 0};
      const Real* x = inverse_.data() + j * d;
      if (rows == 4) {
        for (std::size_t k = 0; k < columns; ++k) {
          for (std::size_t r = 0; r < 4; ++r) y[r] += x[r * d + k] * f[k];
        }
      } else {
        for (std::size_t k = 0; k < columns; ++k) {
          for (std::size_t r = 0; r < rows; ++r) y[r] += x[r * d + k] * f[k];
        }
      }
      total += (y[0] * y[0] + y[1] * y[1]) + (y[2] * y[2] + y[3] * y[3]);
    }
  }
  return total;
}

template <class Real>
Real InformationIn<Real>::magnitude(const InformationSet& set, std::size_t candidate) const {
  using std::abs;
  if (!set.has_factors()) return magnitude(set.information(candidate));
  const std::size_t d = dimension_;
  const auto factor = set.factor(candidate);
  Real total = 0;
  for (std::size_t from = 0; from < factor.size(); from += d) {
    for (std::size_t j = 0; j < d; ++j) {
      Real sum = 0;
      for (std::size_t k = 0; k < d; ++k) sum += abs(inverse_[j * d + k] * factor[from + k]);
      total += sum * sum;
    }
  }
  return total;
}

template <class Real>
double InformationIn<Real>::largest_magnitude(const InformationSet& set,
                                              std::size_t candidate) const {
  if (!set.has_factors()) return largest_magnitude(set.information(candidate));
  const auto factor = set.factor(candidate);
  double sum = 0.0;
  for (std::size_t from = 0; from < factor.size(); from += dimension_) {
    for (std::size_t a = 0; a < dimension_; ++a) {
      const double f = factor[from + a];
      sum += diagonal_[a] * f * f;
    }
  }
  return 1.001 * static_cast<double>(dimension_) * sum;
}

template <class Real>
Real InformationIn<Real>::trace_unit(const InformationSet& set) const {
  if (!set.has_factors()) return trace_unit();
  return static_cast<Real>(3 * (set.rank() * dimension_ + 2 * dimension_ + 4)) * unit<Real>();
}

template class InformationIn<Extended>;
template class InformationIn<Quadruple>;

}  // namespace graybox
