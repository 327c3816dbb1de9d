// Weighted linear least squares y = W p + e for torques of several joints over time, where joint j
// has noise of its own unknown variance s_j^2 (Gautier and Poignet 2001: IDIM-LS with weights).
//
// Estimate. p minimises sum over j and t of (y_jt - W_jt p)^2 / s_j^2, the variances from the
// residuals of the fit before, s_j^2 = e_j^T e_j / (N_j - p N_j / N), until nothing changes.
//
// Covariance. Filtered signals and missing physics leave residuals that are correlated in time and
// between joints; the textbook (W^T S^-1 W)^-1, which takes them for white, is then too small. With
// the scores g_t = sum over j of W_jt^T e_jt / s_j^2 and H = W^T S^-1 W,
//   cov = H^-1 G H^-1 N/(N - p),   G = sum over all lags of the autocovariances of g.
// G is the long-run variance of long_run_variance.hpp, with the number of lags from AR(1) models
// weighted by their spectra (Andrews 1991, equation 6.4, Bartlett kernel). From three recordings on
// it is widened by the spread between them (recording_spread.hpp).
//
// Cost O(N p^2) an iteration, O(L N p^2 / n) for the covariance.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

// Rows are time-major: n rows, one a joint, for each time.
struct TorqueRows {
  Eigen::MatrixXd columns;
  Eigen::VectorXd torque;
  Eigen::Index joints = 1;
  std::vector<Eigen::Index> piece_samples;  // consecutive times of each piece, at least 3
  // The recording that each piece is of, rising; empty: nothing is known of recordings.
  std::vector<Eigen::Index> piece_recordings{};

  [[nodiscard]] Eigen::Index samples() const { return torque.size() / joints; }
};

struct WeightedRegression {
  Eigen::VectorXd parameters;
  Eigen::VectorXd noise;       // s_j
  Eigen::VectorXd residuals;   // y - W p
  Eigen::MatrixXd covariance;  // of the parameters
  Eigen::Index lags = 0;       // L
  double condition = 0.0;      // of the weighted columns, each scaled to length one
  int iterations = 0;
  bool converged = false;
};

// Without columns there is nothing to estimate but the noise. W must have full column rank and more
// rows than columns. A joint that is fitted exactly keeps a noise of 1e-9 of its torque's root mean
// square. Joints of unlike units can't have equal noise.
enum class JointNoise {
  kEach,   // of its own in each joint
  kEqual,  // one for all: ordinary least squares
};
[[nodiscard]] WeightedRegression weighted_regression(const TorqueRows& rows,
                                                     JointNoise kind = JointNoise::kEach);

// 1/s_j for every one of `rows` rows.
[[nodiscard]] Eigen::VectorXd row_weights(const Eigen::VectorXd& noise, Eigen::Index rows);

// The parameters alone, for known s_j.
[[nodiscard]] Eigen::VectorXd solve_weighted(const TorqueRows& rows, const Eigen::VectorXd& noise);

// The covariance above for these residuals.
[[nodiscard]] Eigen::MatrixXd correlated_covariance(const TorqueRows& rows,
                                                    const Eigen::VectorXd& residuals,
                                                    const Eigen::VectorXd& noise,
                                                    Eigen::Index& lags);

// Andrews 1991 (6.4): L = 1.1447 (a N)^(1/3), a a mean of 4 r^2/((1-r)^2 (1+r)^2) over AR(1) models
// of these correlations, weighted by the squares of their spectra at zero for variance one,
// ((1-r^2)/(1-r)^2)^2; at most N/4.
[[nodiscard]] Eigen::Index andrews_lags(const Eigen::VectorXd& correlations, Eigen::Index samples);

}  // namespace graybox
