#include "solvers/ellipsoid/support_frame.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <numeric>

#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

using ExtendedMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using ExtendedVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

constexpr long double kUnit = std::numeric_limits<long double>::epsilon() / 2;

// sum_k u_k x_k, summed as differences from the first point.
ExtendedVector weighted_mean(const PointSet& points, const WeightedPoints& support,
                             long double total) {
  const auto n = static_cast<Eigen::Index>(points.dimension);
  const double* first = points.point(support.indices.front());
  ExtendedVector mean = ExtendedVector::Zero(n);
  for (std::size_t k = 0; k < support.indices.size(); ++k) {
    const double* x = points.point(support.indices[k]);
    for (Eigen::Index j = 0; j < n; ++j) {
      mean(j) += support.weights[k] * (static_cast<long double>(x[j]) - first[j]);
    }
  }
  for (Eigen::Index j = 0; j < n; ++j) mean(j) = mean(j) / total + first[j];
  return mean;
}

void set_centre(const ExtendedVector& centre, Ellipsoid& frame) {
  for (std::size_t j = 0; j < frame.dimension; ++j) {
    const long double value = centre(static_cast<Eigen::Index>(j));
    frame.centre[j] = static_cast<double>(value);
    frame.remainder[j] = static_cast<double>(value - frame.centre[j]);
  }
}

// Whether a column of R is what rounding leaves of the columns before it.
bool is_singular(const ExtendedMatrix& r) {
  for (Eigen::Index j = 0; j < r.cols(); ++j) {
    const long double length = r.col(j).head(j + 1).norm();
    const auto count = static_cast<long double>(r.cols());
    if (!(std::abs(r(j, j)) > 64 * count * kUnit * length)) return true;
  }
  return false;
}

}  // namespace

bool support_frame(const PointSet& points, const WeightedPoints& support, bool centred,
                   Ellipsoid& frame) {
  const auto n = static_cast<Eigen::Index>(points.dimension);
  const auto m = static_cast<Eigen::Index>(support.indices.size());
  if (m < n) return false;
  frame.dimension = points.dimension;
  frame.centre.assign(points.dimension, 0.0);
  frame.remainder.assign(points.dimension, 0.0);
  frame.factor.resize(packed_size(points.dimension));
  const long double total = std::accumulate(support.weights.begin(), support.weights.end(), 0.0L);
  ExtendedVector centre = ExtendedVector::Zero(n);
  if (!centred) centre = weighted_mean(points, support, total);
  set_centre(centre, frame);
  ExtendedMatrix rows(m, n);
  for (Eigen::Index k = 0; k < m; ++k) {
    const auto member = static_cast<std::size_t>(k);
    const double* x = points.point(support.indices[member]);
    const long double root = std::sqrt(support.weights[member] / total);
    for (Eigen::Index j = 0; j < n; ++j) rows(k, j) = root * (x[j] - centre(j));
  }
  const Eigen::HouseholderQR<ExtendedMatrix> qr(rows);
  ExtendedMatrix r = qr.matrixQR().topRows(n).triangularView<Eigen::Upper>();
  if (is_singular(r)) return false;
  const ExtendedMatrix inverse =
      r.triangularView<Eigen::Upper>().solve(ExtendedMatrix::Identity(n, n));
  for (Eigen::Index i = 0; i < n;
       ++i) {  // F = R^-T, its rows signed so that the diagonal is positive
    const long double sign = inverse(i, i) > 0 ? 1 : -1;
    for (Eigen::Index j = 0; j <= i; ++j) {
      frame.factor[packed_index(static_cast<std::size_t>(i), static_cast<std::size_t>(j))] =
          static_cast<double>(sign * inverse(j, i));
    }
  }
  return true;
}

// Each entry is a chain of at most n + 3 operations on terms that |F| (|x - c| + |r|) bounds.
void place_in_frame(const PointSet& points, std::size_t i, const Ellipsoid& frame,
                    ExtendedPlace& place) {
  const std::size_t n = frame.dimension;
  const double* x = points.point(i);
  const double *centre = frame.centre.data(), *remainder = frame.remainder.data();
  place.y.resize(n);
  const long double gamma = static_cast<long double>(n + 8) * kUnit;
  long double squared_error = 0;
  const double* factor = frame.factor.data();
  for (std::size_t row = 0; row < n; ++row) {
    long double sum = 0, magnitude = 0;
    for (std::size_t j = 0; j <= row; ++j) {
      const long double f = *factor++;
      const long double away = static_cast<long double>(x[j]) - centre[j];
      sum += f * (away - remainder[j]);
      magnitude += std::abs(f) * (std::abs(away) + std::abs(remainder[j]));
    }
    place.y[row] = sum;
    squared_error += magnitude * magnitude;
  }
  place.error = gamma * std::sqrt(squared_error);
}

}  // namespace graybox
