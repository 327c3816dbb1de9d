#include "solvers/ellipsoid/ellipsoid_certificate.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/base/aligned_array.hpp"
#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

using ExtendedMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using ExtendedVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kDoubleUnit = std::numeric_limits<double>::epsilon() / 2;
constexpr long double kUnit = std::numeric_limits<long double>::epsilon() / 2;

double rounded_up(long double value) {
  return std::nextafter(static_cast<double>(value), kInfinity);
}

// The bound on the error of any y computed in double precision.
double double_error(const PointSet& points, const Ellipsoid& ellipsoid) {
  const std::size_t n = points.dimension;
  std::vector<double> reach(n);
  for (std::size_t j = 0; j < n; ++j) {
    const double c = ellipsoid.centre[j];
    reach[j] = std::max(std::abs(points.upper[j] - c), std::abs(points.lower[j] - c)) +
               std::abs(ellipsoid.remainder[j]);
  }
  double squares = 0.0;
  for (std::size_t row = 0; row < n; ++row) {
    double sum = 0.0;
    for (std::size_t j = 0; j <= row; ++j) {
      sum += std::abs(ellipsoid.factor[packed_index(row, j)]) * reach[j];
    }
    squares += sum * sum;
  }
  return 1.01 * static_cast<double>(n + 8) * kDoubleUnit * std::sqrt(squares);
}

// An upper bound of |F (x_i - c)| in extended precision.
long double extended_distance(const PointSet& points, std::size_t i, const Ellipsoid& ellipsoid,
                              ExtendedPlace& place) {
  place_in_frame(points, i, ellipsoid, place);
  long double squares = 0;
  for (const long double y : place.y) squares += y * y;
  const auto chain = static_cast<long double>(points.dimension + 4);
  return std::sqrt(squares) * (1 + chain * kUnit) + place.error;
}

void bound_distances(const PointSet& points, const Ellipsoid& ellipsoid, int threads,
                     EllipsoidCertificate& certificate) {
  AlignedArray squares(points.count);
  static_cast<void>(
      squared_distances(points, ellipsoid, threads, StopClock::never(), squares.span()));
  const double error = double_error(points, ellipsoid) * (1.0 + 1e-10);
  const double relative = static_cast<double>(points.dimension + 4) * kDoubleUnit;
  const double* best = std::max_element(squares.begin(), squares.end());
  if (!std::isfinite(*best) || !std::isfinite(error)) {
    certificate.largest_distance = kInfinity;
    certificate.farthest = static_cast<std::size_t>(best - squares.begin());
    return;
  }
  // What is not in question is shorter than the longest, for sure.
  const double in_question = std::sqrt(*best) * (1.0 - 3.0 * relative) - 2.0 * error;
  const double threshold = in_question > 0.0 ? in_question * in_question : 0.0;
  std::vector<std::size_t> questions;
  for (std::size_t i = 0; i < points.count; ++i) {
    if (squares[i] >= threshold) questions.push_back(i);
  }
  std::vector<double> bounds(questions.size());
  const auto count = static_cast<std::ptrdiff_t>(questions.size());
#pragma omp parallel num_threads(threads) if (threads > 1 && count > 1000)
  {
    ExtendedPlace place;
#pragma omp for schedule(static)
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      const auto q = static_cast<std::size_t>(k);
      bounds[q] = rounded_up(extended_distance(points, questions[q], ellipsoid, place));
    }
  }
  const auto largest = std::ranges::max_element(bounds);
  certificate.largest_distance = *largest;
  certificate.farthest = questions[static_cast<std::size_t>(largest - bounds.begin())];
}

// G and a bound on the Frobenius norm of its error.
struct SecondMoments {
  ExtendedMatrix matrix;
  long double error = 0;
};

SecondMoments second_moments(const PointSet& points, const Ellipsoid& ellipsoid,
                             const WeightedPoints& support, bool centred) {
  const auto n = static_cast<Eigen::Index>(points.dimension);
  const auto m = static_cast<Eigen::Index>(support.indices.size());
  ExtendedMatrix places(n, m);
  ExtendedVector weights(m);
  long double place_error = 0;
  ExtendedPlace place;
  for (Eigen::Index k = 0; k < m; ++k) {
    const auto member = static_cast<std::size_t>(k);
    place_in_frame(points, support.indices[member], ellipsoid, place);
    places.col(k) = Eigen::Map<const ExtendedVector>(place.y.data(), n);
    weights(k) = std::max(support.weights[member], 0.0);
    if (weights(k) > 0) place_error = std::max(place_error, place.error);
  }
  weights /= weights.sum();
  const auto chain = static_cast<long double>(m + 8);
  if (!centred) {
    const ExtendedVector mean = places * weights;
    const long double size = places.colwise().norm() * weights;
    places.colwise() -= mean;
    place_error += place_error + 2 * chain * kUnit * size;
  }
  const long double first = places.colwise().norm() * weights;
  const long double second = places.colwise().squaredNorm() * weights;
  const auto dimension = static_cast<long double>(n);
  SecondMoments moments;
  moments.matrix = dimension * (places * weights.asDiagonal() * places.transpose());
  moments.error = dimension * (2 * place_error * first + place_error * place_error +
                               4 * chain * kUnit * second);
  return moments;
}

// -1/2 log det G and the bound on its error; infinity where G is not certainly regular.
struct VolumeGap {
  long double value = std::numeric_limits<long double>::infinity();
  long double error = 0;
};

VolumeGap volume_gap(const SecondMoments& moments) {
  const Eigen::Index n = moments.matrix.rows();
  const Eigen::LLT<ExtendedMatrix> cholesky(moments.matrix);
  if (cholesky.info() != Eigen::Success || !moments.matrix.allFinite()) return {};
  const ExtendedMatrix lower = cholesky.matrixL();
  const ExtendedMatrix inverse =
      lower.triangularView<Eigen::Lower>().solve(ExtendedMatrix::Identity(n, n));
  // Higham 2002, theorem 10.3: the factor is that of a matrix that differs by gamma |L| |L^T|.
  const auto chain = static_cast<long double>(n + 2);
  const long double perturbation = moments.error + 2 * chain * kUnit * moments.matrix.trace();
  const long double ratio = 1.1L * inverse.squaredNorm() * perturbation;
  if (!(ratio < 0.1L)) return {};
  long double logarithms = 0, sizes = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const long double logarithm = std::log(lower(k, k));
    logarithms += logarithm;
    sizes += std::abs(logarithm);
  }
  const auto dimension = static_cast<long double>(n);
  return {-logarithms, 0.5L * dimension * ratio / (1 - ratio) + 4 * chain * kUnit * (sizes + 1)};
}

}  // namespace

EllipsoidCertificate certify_ellipsoid(const PointSet& points, const Ellipsoid& ellipsoid,
                                       const WeightedPoints& support, bool centred, int threads) {
  EllipsoidCertificate certificate;
  bound_distances(points, ellipsoid, threads, certificate);
  certificate.log_volume = log_volume(ellipsoid);
  certificate.volume_bound = kInfinity;
  if (std::ranges::none_of(support.weights, [](double weight) { return weight > 0.0; })) {
    return certificate;
  }
  const VolumeGap gap = volume_gap(second_moments(points, ellipsoid, support, centred));
  long double bound = gap.value + gap.error;
  if (certificate.largest_distance > 1.0) {
    bound += static_cast<long double>(points.dimension) *
             std::log(static_cast<long double>(certificate.largest_distance));
  }
  certificate.volume_bound = rounded_up(std::expm1(bound));
  certificate.rounding_bound = rounded_up(gap.error);
  return certificate;
}

}  // namespace graybox
