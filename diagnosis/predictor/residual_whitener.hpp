// Residuals made white: what an autoregression of each output's own residuals leaves,
//
//   w_k = e_k - sum over i of a_i e_(k-i),     i = 1 ... 10,
//
// a by the Yule-Walker equations over all runs (Box and Jenkins, Time Series Analysis, 1970). Rows
// are those of a task: sample by sample, outputs within each; none reaches into the run before.
//
//   const ResidualWhitener whitener(task, outputs, fit.residuals);
//   const Eigen::VectorXd white = whitener.apply(other_residuals);
#pragma once

#include <Eigen/Core>

#include "diagnosis/predictor/prediction_data.hpp"

namespace graybox {

class ResidualWhitener {
 public:
  // The task is kept by reference.
  ResidualWhitener(const PredictionTask& task, Eigen::Index outputs,
                   const Eigen::VectorXd& residuals);

  [[nodiscard]] Eigen::VectorXd apply(const Eigen::VectorXd& residuals) const;

 private:
  void fit(Eigen::Index output, const Eigen::VectorXd& residuals);

  const PredictionTask* task_;
  Eigen::Index outputs_;
  Eigen::MatrixXd filter_;  // outputs x lags
};

// How much more the poorer of two fits leaves, over the variance of what the richer does, both made
// white as the richer's rest is: chi-square where nothing speaks for the richer.
[[nodiscard]] double white_evidence(const PredictionTask& task, Eigen::Index outputs,
                                    const Eigen::VectorXd& poorer, const Eigen::VectorXd& richer);

}  // namespace graybox
