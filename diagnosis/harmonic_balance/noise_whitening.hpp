// Weights of residuals from estimates of the noise's covariance.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/responses/covariance_pool.hpp"

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

// The least samples and the mean number of lines of covariances pooled from these.
[[nodiscard]] NoisePool pool_of(const std::vector<LineScatter>& lines,
                                const std::vector<OutputCovariance>& pooled);

// The inverse of a covariance of n_y outputs estimated with q degrees of freedom is too large by
// q / (q - n_y) on average: the covariance times that.
[[nodiscard]] double inverse_bias(double degrees_of_freedom, Eigen::Index outputs);

// Chi-square of residuals that were whitened with estimated covariances, over its degrees of
// freedom, scatters more than a chi-square variable does: it is about one over these degrees of
// freedom instead, of which its variance is that of
//   chi^2 = sum_k sum_r e^H W_k e,   W = (q - n) S^-1,
//   S a complex Wishart matrix of n outputs and q samples,
// with E W = 1, the same for all records of a group at line k. By its moments (Shaman, J.
// Multivariate Anal. 10, 1980)
//   Var = sum_groups 2 N a + 2 N^2 b / (2 n m),
//   N numbers, m complex degrees of freedom in the group,
//   a = E tr W^2 / n = q (q - n) / ((q - n)^2 - 1),   b = (q / n) Var tr W = q^2 / ((q - n)^2 - 1),
// a, b -> 1 for many samples, which is Fisher's F. `degrees_of_freedom`: of the records' numbers,
// those of the fitted parameters taken off. The same where the noise is stated.
[[nodiscard]] double effective_degrees_of_freedom(const PeriodicData& data,
                                                  const std::vector<MeasuredRecord>& records,
                                                  double degrees_of_freedom);

// Half the variance of the sum of so many squared numbers of one group, as above: those of
// `channels` of its outputs, at a share of its lines.
[[nodiscard]] double half_variance(const NoisePool& pool, Eigen::Index outputs, double numbers,
                                   double channels, double share_of_lines);

}  // namespace graybox
