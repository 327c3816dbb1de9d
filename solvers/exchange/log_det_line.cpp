#include "solvers/exchange/log_det_line.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace graybox {

LogDetLine::LogDetLine(std::size_t dimension)
    : dimension_(dimension),
      diagonal_(dimension),
      off_diagonal_(dimension),
      reflector_(dimension),
      product_(dimension) {}

void LogDetLine::set_direction(std::span<double> direction) {
  const std::size_t d = dimension_;
  double* c = direction.data();
  double* v = reflector_.data();
  double* q = product_.data();
  for (std::size_t k = 0; k + 1 < d; ++k) {
    // Reflector that maps column k below the diagonal onto its first entry.
    double norm_squared = 0.0;
    for (std::size_t i = k + 1; i < d; ++i) {
      v[i] = c[i * d + k];
      norm_squared += v[i] * v[i];
    }
    const double norm = std::sqrt(norm_squared);
    off_diagonal_[k] = v[k + 1] > 0.0 ? -norm : norm;
    const double beta = norm_squared - v[k + 1] * off_diagonal_[k];  // v.v / 2
    if (!(beta > 0.0)) continue;
    v[k + 1] -= off_diagonal_[k];
    // Rank-two update of the trailing block: C <- C - v q^T - q v^T.
    double overlap = 0.0;
    for (std::size_t i = k + 1; i < d; ++i) {
      double sum = 0.0;
      for (std::size_t j = k + 1; j < d; ++j) sum += c[i * d + j] * v[j];
      q[i] = sum / beta;
      overlap += q[i] * v[i];
    }
    for (std::size_t i = k + 1; i < d; ++i) q[i] -= overlap / (2.0 * beta) * v[i];
    for (std::size_t i = k + 1; i < d; ++i) {
      for (std::size_t j = k + 1; j < d; ++j) c[i * d + j] -= v[i] * q[j] + q[i] * v[j];
    }
  }
  for (std::size_t k = 0; k < d; ++k) diagonal_[k] = c[k * d + k];
}

double LogDetLine::slope_at_zero() const {
  double sum = 0.0;
  for (std::size_t k = 0; k < dimension_; ++k) sum += diagonal_[k];
  return sum;
}

double LogDetLine::value(double a) const {
  double sum = 0.0;
  double pivot = 1.0;
  for (std::size_t k = 0; k < dimension_; ++k) {
    const double coupling = k == 0 ? 0.0 : a * off_diagonal_[k - 1];
    pivot = 1.0 + a * diagonal_[k] - coupling * coupling / pivot;
    if (!(pivot > 0.0)) return -std::numeric_limits<double>::infinity();
    sum += std::log(pivot);
  }
  return sum;
}

// The error that rounding leaves in a slope near zero.
double LogDetLine::slope_rounding() const {
  double size = 0.0;
  for (std::size_t k = 0; k < dimension_; ++k) size += std::abs(diagonal_[k]);
  for (std::size_t k = 0; k + 1 < dimension_; ++k) size += std::abs(off_diagonal_[k]);
  return 4.0 * std::numeric_limits<double>::epsilon() * size;
}

LogDetLine::Derivatives LogDetLine::derivatives(double a) const {
  Derivatives result;
  double q = 1.0, q1 = 0.0, q2 = 0.0;  // pivot and its derivatives with respect to a
  for (std::size_t k = 0; k < dimension_; ++k) {
    const double b = k == 0 ? 0.0 : off_diagonal_[k - 1];
    // With r = b^2/q:  (a^2 r)' = 2 a r + a^2 r',  (a^2 r)'' = 2 r + 4 a r' + a^2 r''.
    const double r = b * b / q;
    const double r1 = -r * q1 / q;
    const double r2 = -(r * q2 + 2.0 * r1 * q1) / q;
    q = 1.0 + a * diagonal_[k] - a * a * r;
    q1 = diagonal_[k] - 2.0 * a * r - a * a * r1;
    q2 = -2.0 * r - 4.0 * a * r1 - a * a * r2;
    if (!(q > 0.0)) return result;
    const double relative = q1 / q;
    result.slope += relative;
    result.curvature += q2 / q - relative * relative;
  }
  result.definite = std::isfinite(result.slope) && std::isfinite(result.curvature);
  return result;
}

double LogDetLine::maximise(double lowest, double highest) const {
  const Derivatives start = derivatives(0.0);
  if (start.slope == 0.0) return 0.0;
  const double end = start.slope > 0.0 ? highest : lowest;
  const double sign = start.slope > 0.0 ? 1.0 : -1.0;
  if (end == 0.0) return 0.0;
  const double longest = std::abs(end);
  if (std::isfinite(longest)) {
    const Derivatives last = derivatives(end);
    if (last.definite && sign * last.slope >= 0.0) return end;
  }
  // Lengths along the direction of ascent: the maximiser lies between inside and outside.
  double inside = 0.0, outside = longest, length = 0.0;
  Derivatives here = start;
  const double rounding = slope_rounding();
  for (int iteration = 0; iteration < 100; ++iteration) {
    double next = length - sign * here.slope / here.curvature;
    if (!(next > inside && next < outside)) {
      next = std::isfinite(outside) ? 0.5 * (inside + outside) : 2.0 * inside + 1.0;
    }
    if (std::abs(next - length) <= 1e-13 * next) return sign * next;
    length = next;
    here = derivatives(sign * length);
    // Beyond the definite range there is no slope to follow: step back by bisection.
    while (!here.definite) {
      outside = length;
      length = 0.5 * (inside + outside);
      if (length == inside || length == outside) return sign * inside;
      here = derivatives(sign * length);
    }
    if (std::abs(here.slope) <= rounding) return sign * length;
    (sign * here.slope > 0.0 ? inside : outside) = length;
  }
  return sign * length;
}

}  // namespace graybox
