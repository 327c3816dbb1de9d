// The covariance of a sum of scores that are correlated in time: what standard errors need where
// residuals are not white.
//
//   V = sum over all lags of the autocovariances of g,   g_t the scores, rows of a matrix,
//
// estimated with prewhitening (Andrews and Monahan, Econometrica 60, 1992): r_a the first
// autocorrelation of score a, within +-0.97, h_t = g_t - diag(r) g_(t-1),
//
//   V = D (Gamma_0 + sum of (1 - l/(L+1)) (Gamma_l + Gamma_l^T)) D,   D = diag(1/(1 - r)),
//
// Gamma_l = sum over t of h_t h_(t-l)^T (Newey and West, Econometrica 55, 1987). No lag reaches
// across a gap between pieces. V is positive semidefinite.
//
//   const PrewhitenedScores scores(g, {g.rows()});
//   const Eigen::MatrixXd v = scores.long_run_variance(lags);   // L by a rule of the caller's
//
// How many lags: 1.1447 (a n)^(1/3) of AR(1) models of h (Andrews, Econometrica 59, 1991, (6.2) and
// (6.4)); `whitened_correlations` are theirs.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

class PrewhitenedScores {
 public:
  // `pieces`: rows of each run of consecutive times, all of `scores`.
  PrewhitenedScores(const Eigen::MatrixXd& scores, std::vector<Eigen::Index> pieces);

  // First autocorrelations of h, within +-0.97.
  [[nodiscard]] Eigen::VectorXd whitened_correlations() const;
  // Rows of h: one fewer a piece than there were scores.
  [[nodiscard]] Eigen::Index samples() const { return whitened_.rows(); }
  [[nodiscard]] Eigen::MatrixXd long_run_variance(Eigen::Index lags) const;

 private:
  std::vector<Eigen::Index> pieces_;  // of whitened_
  Eigen::VectorXd correlations_;
  Eigen::MatrixXd whitened_;
};

}  // namespace graybox
