#include "graybox/diagnosis/periodic_mismatch/noise_whitening.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace graybox {

Eigen::MatrixXd output_level(const PeriodicData& data, std::size_t group) {
  Eigen::MatrixXd power =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(data.outputs.size()), data.last_line + 1);
  double count = 0.0;
  for (const auto* records : {&data.estimation, &data.validation}) {
    for (const MeasuredRecord& record : *records) {
      if (record.group != group) continue;
      power += record.output.cwiseAbs2();
      count += 1.0;
    }
  }
  return (power / std::max(count, 1.0)).cwiseSqrt();
}

std::optional<Eigen::MatrixXcd> whitening_of(Eigen::MatrixXcd covariance,
                                             const Eigen::VectorXd& level, double accuracy) {
  covariance.diagonal().real() += (accuracy * level).cwiseAbs2();
  const Eigen::LLT<Eigen::MatrixXcd> factor(covariance);
  if (factor.info() != Eigen::Success || !(covariance.diagonal().real().minCoeff() > 0.0)) {
    return {};
  }
  const Eigen::Index n = covariance.rows();
  return std::sqrt(2.0) * factor.matrixL().solve(Eigen::MatrixXcd::Identity(n, n));
}

std::vector<std::vector<Eigen::MatrixXcd>> whitening_with_errors(const PeriodicData& data,
                                                                 double share) {
  auto result = data.whitening;
  for (std::size_t group = 0; group < result.size(); ++group) {
    const Eigen::MatrixXd level = output_level(data, group);
    for (Eigen::Index k = data.first_line; k <= data.last_line; ++k) {
      Eigen::MatrixXcd& whitening = result[group][static_cast<std::size_t>(k)];
      const Eigen::MatrixXcd covariance = 2.0 * (whitening.adjoint() * whitening).inverse();
      if (auto raised = whitening_of(covariance, level.col(k), share)) {
        whitening = std::move(*raised);
      }
    }
  }
  return result;
}

NoisePool pool_of(const std::vector<OutputCovariance>& pooled) {
  NoisePool result{std::numeric_limits<double>::infinity(), 0.0};
  for (const OutputCovariance& one : pooled) {
    result.samples = std::min(result.samples, one.degrees_of_freedom);
    result.lines += static_cast<double>(one.pooled_lines) / static_cast<double>(pooled.size());
  }
  return result;
}

double inverse_bias(double degrees_of_freedom, Eigen::Index outputs) {
  const auto size = static_cast<double>(outputs);
  return degrees_of_freedom > size ? degrees_of_freedom / (degrees_of_freedom - size) : 1.0;
}

}  // namespace graybox
