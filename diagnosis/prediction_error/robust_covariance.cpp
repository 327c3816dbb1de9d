#include "diagnosis/prediction_error/robust_covariance.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace graybox {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Eigen::MatrixXd robust_covariance(const VectorXd& residuals, const MatrixXd& jacobian,
                                  const BlockEdges& edges) {
  constexpr double kUnseen = 1e-10;  // of a scaled normal matrix
  const Index p = jacobian.cols();
  const VectorXd scale = jacobian.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const MatrixXd j = jacobian * scale.asDiagonal();
  const MatrixXd normal = j.transpose() * j;
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> inverse(normal);
  inverse.setThreshold(kUnseen);
  MatrixXd middle = MatrixXd::Zero(p, p);
  for (std::size_t b = 0; b + 1 < edges.size(); ++b) {
    const Index from = edges[b], count = edges[b + 1] - from;
    const VectorXd g = j.middleRows(from, count).transpose() * residuals.segment(from, count);
    middle += g * g.transpose();
  }
  const auto counted = static_cast<double>((residuals.array() != 0.0).count());
  const double white = residuals.squaredNorm() / std::max(1.0, counted - static_cast<double>(p));
  const MatrixXd pinv = inverse.pseudoInverse();
  const MatrixXd robust = pinv * middle * pinv, plain = white * pinv;
  MatrixXd covariance = robust;
  for (Index i = 0; i < p; ++i) {
    covariance(i, i) = std::max(robust(i, i), plain(i, i)) * scale(i) * scale(i);
    if (inverse.rank() < p) {  // a direction that the data do not see
      const VectorXd seen = pinv * (normal * VectorXd::Unit(p, i));
      if (std::abs(seen(i) - 1.0) > 1e-3) {
        covariance(i, i) = std::numeric_limits<double>::quiet_NaN();
      }
    }
  }
  return covariance;
}

}  // namespace graybox
