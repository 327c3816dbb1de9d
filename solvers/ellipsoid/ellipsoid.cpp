#include "solvers/ellipsoid/ellipsoid.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

using ExtendedMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

Eigen::MatrixXd full_factor(const Ellipsoid& ellipsoid) {
  const auto n = static_cast<Eigen::Index>(ellipsoid.dimension);
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(n, n);
  std::size_t k = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) factor(i, j) = ellipsoid.factor[k++];
  }
  return factor;
}

}  // namespace

double log_unit_ball_volume(std::size_t dimension) {
  const double half = 0.5 * static_cast<double>(dimension);
  return half * std::log(std::numbers::pi) - std::lgamma(half + 1.0);
}

double log_volume(const Ellipsoid& ellipsoid) {
  long double sum = log_unit_ball_volume(ellipsoid.dimension);
  for (std::size_t i = 0; i < ellipsoid.dimension; ++i) {
    sum -= std::log(static_cast<long double>(ellipsoid.factor[packed_index(i, i)]));
  }
  return static_cast<double>(sum);
}

std::vector<double> shape_matrix(const Ellipsoid& ellipsoid) {
  const std::size_t n = ellipsoid.dimension;
  std::vector<double> shape(n * n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      long double sum = 0;
      for (std::size_t k = i; k < n; ++k) {
        sum += static_cast<long double>(ellipsoid.factor[packed_index(k, i)]) *
               ellipsoid.factor[packed_index(k, j)];
      }
      shape[i * n + j] = shape[j * n + i] = static_cast<double>(sum);
    }
  }
  return shape;
}

// E = F^T F with F lower triangular is a Cholesky factorisation from the last row up: that of E
// with rows and columns in reverse order, E' = L L^T, gives F = (L^T reversed).
std::vector<double> factor_of_shape(const std::vector<double>& shape, std::size_t dimension) {
  const auto n = static_cast<Eigen::Index>(dimension);
  ExtendedMatrix reversed(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      reversed(n - 1 - i, n - 1 - j) = shape[static_cast<std::size_t>(i * n + j)];
    }
  }
  const Eigen::LLT<ExtendedMatrix> cholesky(reversed);
  if (cholesky.info() != Eigen::Success) return {};
  const ExtendedMatrix lower = cholesky.matrixL();
  std::vector<double> factor(packed_size(dimension));
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      factor[packed_index(static_cast<std::size_t>(i), static_cast<std::size_t>(j))] =
          static_cast<double>(lower(n - 1 - j, n - 1 - i));
    }
  }
  return factor;
}

std::vector<SemiAxis> semi_axes(const Ellipsoid& ellipsoid) {
  const auto n = static_cast<Eigen::Index>(ellipsoid.dimension);
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(full_factor(ellipsoid), Eigen::ComputeFullV);
  std::vector<SemiAxis> axes(ellipsoid.dimension);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index column = n - 1 - k;  // the smallest singular value is the longest axis
    Eigen::VectorXd direction = svd.matrixV().col(column);
    Eigen::Index largest = 0;
    direction.cwiseAbs().maxCoeff(&largest);
    if (direction(largest) < 0.0) direction = -direction;
    axes[static_cast<std::size_t>(k)] = {1.0 / svd.singularValues()(column),
                                         {direction.begin(), direction.end()}};
  }
  return axes;
}

}  // namespace graybox
