#include "graybox/solvers/certificate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "graybox/problems/packed_matrix.hpp"

namespace graybox {
namespace {

using Real = long double;  // 64-bit significand on x86-64
constexpr Real kUnit = std::numeric_limits<Real>::epsilon() / 2;

// A dense lower triangle or square of extended numbers, row-major.
using Matrix = std::vector<Real>;

// Clips and renormalises. False, with certificate.message set, where the weights are no design.
bool read_weights(const InformationSet& set, const Design& design, Certificate& certificate,
                  std::vector<Real>& weights) {
  const std::size_t count = set.candidate_count();
  if (design.weights.size() != count) {
    certificate.message = fmt::format("the design has {} weights, the set {} candidates",
                                      design.weights.size(), count);
    return false;
  }
  Real raw_sum = 0, kept_sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double weight = design.weights[i];
    if (!std::isfinite(weight) || weight < -1e-12) {
      certificate.message = fmt::format("weight {} is {}; weights must not be negative", i, weight);
      return false;
    }
    raw_sum += weight;
    if (weight > 0.0) {
      kept_sum += weight;
      ++certificate.support_size;
    } else {
      certificate.clipped -= weight;
    }
  }
  certificate.renormalised = static_cast<double>(raw_sum - 1);
  if (std::abs(raw_sum - 1) > Real{1e-9}) {
    certificate.message =
        fmt::format("the weights sum to {:.12g}, not 1", static_cast<double>(raw_sum));
    return false;
  }
  weights.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    weights[i] = design.weights[i] > 0.0 ? Real{design.weights[i]} / kept_sum : Real{0};
  }
  return true;
}

// M = sum_i weights_i H_i over the support, packed.
Matrix weighted_sum(const InformationSet& set, const std::vector<Real>& weights) {
  const std::size_t p = set.packed_size();
  Matrix sum(p, 0);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] == 0) continue;
    const auto h = set.information(i);
    for (std::size_t k = 0; k < p; ++k) sum[k] += weights[i] * h[k];
  }
  return sum;
}

// Packed Cholesky factor L of the packed matrix scaled to unit diagonal; log det of the matrix.
bool factorise(const Matrix& packed, const std::vector<Real>& scale, std::size_t d, Matrix& factor,
               Real& log_det) {
  factor = packed;
  log_det = 0;
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      Real value = packed[packed_index(i, j)] * scale[i] * scale[j];
      for (std::size_t k = 0; k < j; ++k) {
        value -= factor[packed_index(i, k)] * factor[packed_index(j, k)];
      }
      if (i == j) {
        // The factor of a matrix of unit diagonal: a pivot at rounding level means singular.
        if (!(value > 8 * static_cast<Real>(d) * kUnit)) return false;
        factor[packed_index(i, i)] = std::sqrt(value);
        log_det += std::log(value) - 2 * std::log(scale[i]);
      } else {
        factor[packed_index(i, j)] = value / factor[packed_index(j, j)];
      }
    }
  }
  return true;
}

// Inverse X = L^-1 S of the scaled factor, packed lower triangle: X M X^T = I up to rounding.
Matrix inverse_factor(const Matrix& factor, const std::vector<Real>& scale, std::size_t d) {
  Matrix inverse(factor.size(), 0);
  for (std::size_t j = 0; j < d; ++j) {
    for (std::size_t i = j; i < d; ++i) {
      Real value = i == j ? Real{1} : Real{0};
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
Real inverse_residual(const Matrix& inverse, const Matrix& packed, std::size_t d,
                      std::size_t support) {
  Matrix product(d * d, 0), magnitude(d * d, 0);  // X M and |X| diag-bound of |M|
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t k = 0; k < d; ++k) {
      for (std::size_t j = 0; j <= i; ++j) {
        const Real x = inverse[packed_index(i, j)];
        product[i * d + k] += x * packed[packed_index(j, k)];
        magnitude[i * d + k] += std::abs(x) * std::sqrt(packed[packed_index(j, j)]) *
                                std::sqrt(packed[packed_index(k, k)]);
      }
    }
  }
  Real residual = 0, rounding = 0;
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j < d; ++j) {
      Real entry = i == j ? Real{-1} : Real{0}, bound = 0;
      for (std::size_t k = 0; k <= j; ++k) {
        entry += product[i * d + k] * inverse[packed_index(j, k)];
        bound += magnitude[i * d + k] * std::abs(inverse[packed_index(j, k)]);
      }
      residual += entry * entry;
      rounding += bound * bound;
    }
  }
  const Real chain = static_cast<Real>(2 * d + support + 8);
  return std::sqrt(residual) + chain * kUnit * std::sqrt(rounding);
}

// W = X^T X in trace-dual packing.
Matrix trace_dual(const Matrix& inverse, std::size_t d) {
  Matrix dual(inverse.size(), 0);
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

// With ||X M X^T - I|| <= delta < 1, M^-1 lies between X^T X / (1 + delta) and X^T X / (1 - delta)
// in the Loewner order, so each tr(M^-1 H_i) is known to within the factors 1/(1 -+ delta), apart
// from the rounding of the trace itself, bounded by the sum of the magnitudes of its terms.
void price(const InformationSet& set, const Matrix& dual, Real delta, Certificate& certificate) {
  const std::size_t p = set.packed_size();
  const Real d = static_cast<Real>(set.dimension());
  const Real chain = static_cast<Real>(p + 2 * set.dimension() + 4) * kUnit;
  Real largest = 0, magnitude_of_largest = 0;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const auto h = set.information(i);
    // Four chains hide the latency of extended additions.
    Real part[4] = {0, 0, 0, 0};
    std::size_t k = 0;
    for (; k + 4 <= p; k += 4) {
      for (std::size_t j = 0; j < 4; ++j) part[j] += dual[k + j] * h[k + j];
    }
    for (; k < p; ++k) part[0] += dual[k] * h[k];
    const Real sensitivity = (part[0] + part[1]) + (part[2] + part[3]);
    if (sensitivity > largest) {
      largest = sensitivity;
      certificate.worst_candidate = i;
    }
  }
  const auto h = set.information(certificate.worst_candidate);
  for (std::size_t k = 0; k < p; ++k) magnitude_of_largest += std::abs(dual[k] * h[k]);
  certificate.duality_gap = static_cast<double>(largest / d - 1);
  certificate.rounding_bound =
      static_cast<double>((largest * delta / (1 - delta) + chain * magnitude_of_largest) / d +
                          std::numeric_limits<double>::epsilon() * std::abs(largest / d - 1));
}

}  // namespace

std::string_view to_string(CertificateStatus status) {
  switch (status) {
    case CertificateStatus::kCertified:
      return "certified";
    case CertificateStatus::kSingular:
      return "singular";
    case CertificateStatus::kNotADesign:
      return "not_a_design";
  }
  return "unknown";
}

Certificate certify(const InformationSet& set, const Design& design) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Certificate certificate;
  certificate.duality_gap = certificate.log_det_gap = certificate.rounding_bound = kInfinity;
  certificate.log_det = -kInfinity;
  std::vector<Real> weights;
  if (!read_weights(set, design, certificate, weights)) return certificate;

  const std::size_t d = set.dimension();
  const Matrix information = weighted_sum(set, weights);
  std::vector<Real> scale(d);
  for (std::size_t i = 0; i < d; ++i) {
    const Real diagonal = information[packed_index(i, i)];
    scale[i] = diagonal > 0 ? 1 / std::sqrt(diagonal) : Real{0};
  }
  Matrix factor;
  Real log_det = 0;
  Real delta = 1;
  Matrix inverse;
  if (std::ranges::all_of(scale, [](Real s) { return s > 0; }) &&
      factorise(information, scale, d, factor, log_det)) {
    inverse = inverse_factor(factor, scale, d);
    delta = inverse_residual(inverse, information, d, certificate.support_size);
  }
  if (!(delta < Real{0.1})) {
    certificate.status = CertificateStatus::kSingular;
    certificate.message =
        "the design's information matrix is singular: it can't estimate all "
        "parameters";
    return certificate;
  }
  certificate.status = CertificateStatus::kCertified;
  certificate.log_det = static_cast<double>(log_det);
  price(set, trace_dual(inverse, d), delta, certificate);
  const double gap = std::max(certificate.duality_gap, 0.0);
  certificate.log_det_gap = static_cast<double>(d) * std::log1p(gap);
  certificate.efficiency = 1.0 / (1.0 + gap);
  return certificate;
}

}  // namespace graybox
