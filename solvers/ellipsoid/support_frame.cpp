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

// sum_k u_k (x_k - x_first): the mean itself would lose digits far from the origin.
ExtendedVector mean_from_first(const PointSet& points, const WeightedPoints& support,
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
  return mean / total;
}

// The centre origin + mean, in two doubles.
void set_centre(const double* origin, const ExtendedVector& mean, Ellipsoid& frame) {
  for (std::size_t j = 0; j < frame.dimension; ++j) {
    const long double offset = mean(static_cast<Eigen::Index>(j));
    frame.centre[j] = static_cast<double>(origin[j] + offset);
    frame.remainder[j] =
        static_cast<double>((origin[j] - static_cast<long double>(frame.centre[j])) + offset);
  }
}

// F = R^-T, its rows signed so that the diagonal is positive.
void set_factor(const ExtendedMatrix& inverse, Ellipsoid& frame) {
  for (std::size_t i = 0; i < frame.dimension; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const long double sign = inverse(column, column) > 0 ? 1 : -1;
    for (std::size_t j = 0; j <= i; ++j) {
      frame.factor[packed_index(i, j)] =
          static_cast<double>(sign * inverse(static_cast<Eigen::Index>(j), column));
    }
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
  const std::vector<double> zero(points.dimension, 0.0);
  const double* origin = centred ? zero.data() : points.point(support.indices.front());
  ExtendedVector mean = ExtendedVector::Zero(n);
  if (!centred) {
    mean = mean_from_first(points, support, total);
    set_centre(origin, mean, frame);
  }
  ExtendedMatrix rows(m, n);
  for (Eigen::Index k = 0; k < m; ++k) {
    const auto member = static_cast<std::size_t>(k);
    const double* x = points.point(support.indices[member]);
    const long double root = std::sqrt(support.weights[member] / total);
    for (Eigen::Index j = 0; j < n; ++j) {
      rows(k, j) = root * ((static_cast<long double>(x[j]) - origin[j]) - mean(j));
    }
  }
  const Eigen::HouseholderQR<ExtendedMatrix> qr(rows);
  ExtendedMatrix r = qr.matrixQR().topRows(n).triangularView<Eigen::Upper>();
  if (is_singular(r)) return false;
  set_factor(r.triangularView<Eigen::Upper>().solve(ExtendedMatrix::Identity(n, n)), frame);
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
