// Weights of residuals from estimates of the noise's covariance.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "graybox/diagnosis/periodic_mismatch/periodic_data.hpp"
#include "graybox/diagnosis/responses/covariance_pool.hpp"

namespace graybox {

// Rms of the outputs of a group's records at each line, n_y x (K + 1).
[[nodiscard]] Eigen::MatrixXd output_level(const PeriodicData& data, std::size_t group);

// L with L (Phi + diag(accuracy level)^2) L^H = 2 I; none where that is not positive definite.
[[nodiscard]] std::optional<Eigen::MatrixXcd> whitening_of(Eigen::MatrixXcd covariance,
                                                           const Eigen::VectorXd& level,
                                                           double accuracy);

// All there is between the lines taken as noise, free motion included: for a start.
[[nodiscard]] std::vector<std::vector<Eigen::MatrixXcd>> whitening_between_lines(
    const PeriodicData& data, std::size_t groups, double accuracy);

// The whitening of data whose model may be wrong by that share of the outputs' level besides.
[[nodiscard]] std::vector<std::vector<Eigen::MatrixXcd>> whitening_with_errors(
    const PeriodicData& data, double share);

// The least samples and the mean number of lines.
[[nodiscard]] NoisePool pool_of(const std::vector<OutputCovariance>& pooled);

// The inverse of a covariance of n_y outputs estimated with q degrees of freedom is too large by
// q / (q - n_y) on average: the covariance times that.
[[nodiscard]] double inverse_bias(double degrees_of_freedom, Eigen::Index outputs);

}  // namespace graybox
