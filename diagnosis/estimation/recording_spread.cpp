#include "diagnosis/estimation/recording_spread.hpp"

#include <cmath>

#include "problems/base/distributions.hpp"

namespace graybox {

Eigen::VectorXd deviations_between(const Eigen::MatrixXd& influences) {
  const Eigen::Index recordings = influences.rows();
  if (recordings < kFewestRecordings) return Eigen::VectorXd::Zero(influences.cols());
  const auto count = static_cast<double>(recordings);
  // Student's quantile, squared, is Fisher's.
  const double few = std::sqrt(fisher_quantile(0.95, 1.0, count - 1.0)) / normal_quantile(0.975);
  return few * std::sqrt(count / (count - 1.0)) * influences.colwise().norm().transpose();
}

Eigen::MatrixXd widened(const Eigen::MatrixXd& covariance, const Eigen::VectorXd& deviations) {
  const Eigen::VectorXd within = covariance.diagonal().cwiseSqrt();
  const Eigen::VectorXd factors =
      (within.array() > 0.0).select(deviations.array() / within.array().max(1e-300), 1.0).max(1.0);
  return factors.asDiagonal() * covariance * factors.asDiagonal();
}

}  // namespace graybox
