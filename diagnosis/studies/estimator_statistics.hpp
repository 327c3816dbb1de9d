// Does an estimator reach the covariance that it should? n independent estimates theta_hat_k of a
// known theta (d parameters) are held against a predicted covariance C = H^-1. Where the estimates
// are normal with covariance Sigma, and with z_k = H^(1/2) (theta_hat_k - theta),
//
//   S = sum_k (z_k - mean) (z_k - mean)^T ~ Wishart_d(n - 1, H^(1/2) Sigma H^(1/2)),
//
// so that, exactly for every n > d,
//
//   determinant   (det Sigma / det C)^(1/d): det S / det(Sigma H) ~ product of independent
//                 chi-squares with n-1, ..., n-d degrees of freedom (Muirhead 1982, theorem
//                 3.2.15);
//   trace         tr(H Sigma) / d: tr S ~ chi-square with d (n-1) where Sigma is proportional to C;
//   variances     Sigma_pp / C_pp: each sample variance is chi-square with n-1;
//   eigenvalues   of S / (n-1): where Sigma = C, those of Wishart_d(n-1, I) / (n-1);
//   bias          Hotelling: n (n-d) / (d (n-1)) m^T C_hat^-1 m ~ F(d, n-d) where there is none,
//                 m the mean error, C_hat the sample covariance (Muirhead 1982, theorem 6.3.1).
//
// Quantiles of the determinant and the eigenvalues come from seeded draws of Wishart matrices
// (Bartlett's decomposition, Muirhead 1982, theorem 3.2.14), all else from distributions.hpp.
//
//   const EfficiencyStatistics result = compare_with_prediction(estimates, theta, covariance);
//   if (result.determinant.contains(1.0)) ...
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace graybox {

struct Interval {
  double estimate = 0.0;
  double lower = 0.0;
  double upper = 0.0;
  [[nodiscard]] bool contains(double value) const { return lower <= value && value <= upper; }
};

inline constexpr int kWishartDraws = 20000;  // quantiles to about 1 % of their spread
inline constexpr double kConfidence = 0.95;  // of every interval here, each by itself

struct EfficiencyStatistics {
  std::size_t estimates = 0;        // n
  Interval determinant;             // estimate: median-unbiased
  Interval trace;                   //
  std::vector<Interval> variances;  // of each parameter
  // Of S / (n - 1), increasing, and the range that each has where Sigma = C.
  Eigen::VectorXd eigenvalues, eigenvalues_lower, eigenvalues_upper;
  Eigen::VectorXd bias;        // mean error over its standard error, by the sample
  double bias_p_value = 1.0;   // of Hotelling's test
  double trace_p_value = 1.0;  // two-sided, of Sigma = C
};

// `estimates` is n x d. Throws InputError for n <= d, sizes that differ, numbers that are not
// finite and a covariance that is not positive definite. O(n d^2 + draws d^3).
[[nodiscard]] EfficiencyStatistics compare_with_prediction(const Eigen::MatrixXd& estimates,
                                                           const Eigen::VectorXd& theta,
                                                           const Eigen::MatrixXd& covariance,
                                                           int draws = kWishartDraws);

// How much larger the covariance of one set of estimates is than that of another, both normal and
// independent.
struct CovarianceRatio {
  Interval determinant;             // (det Sigma_2 / det Sigma_1)^(1/d)
  std::vector<Interval> variances;  // Sigma_2,pp / Sigma_1,pp: by F(n_2 - 1, n_1 - 1)
};
[[nodiscard]] CovarianceRatio compare_covariances(const Eigen::MatrixXd& first,
                                                  const Eigen::MatrixXd& second,
                                                  int draws = kWishartDraws);

// A share of n trials with Wilson's score interval (Wilson 1927).
[[nodiscard]] Interval share_of(std::size_t successes, std::size_t trials);

[[nodiscard]] Eigen::MatrixXd sample_covariance(const Eigen::MatrixXd& estimates);

}  // namespace graybox
