// Whether a fitted parameter changes with something that it should not depend on: with the time, as
// friction that fades while a machine warms up; with the position, as friction of a worn guide.
//
// Beside theta let theta + a c, c the covariate of each sample about its mean. To first order the
// residuals then move by a d, d = c j, j the parameter's column of the Jacobian. With d beside the
// space of all columns (the parameters may take what they can of it),
//
//   a = -d'r / d'd,     z = a d'd / sqrt(sum over blocks of (d_b'(r_b + a d_b))^2).
//
// The blocks are those of left_out_blocks.hpp: residuals may have memory, and change in size
// (White, Econometrica 48, 1980). Cost: a QR of the Jacobian, and a few products for each
// covariate.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/hypotheses/law_trend.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

struct ParameterTrend {
  double slope = 0.0;  // a, in the coordinate of the Jacobian's column over that of the covariate
  double z = 0.0;      // 0: the recordings do not tell
};

class ParameterTrends {
 public:
  // Both are kept by reference. `task`: that of the fit.
  ParameterTrends(const PredictionTask& task, Eigen::Index outputs, const PredictionFit& fit);

  // Time within each run (law_trend.hpp). A value for each sample of all runs, as every covariate.
  [[nodiscard]] Eigen::VectorXd time() const;
  // What each sample adds to the information on the parameter in this column of the Jacobian.
  [[nodiscard]] Eigen::VectorXd told(Eigen::Index column) const;
  // The trend of the parameter in this column of the fit's Jacobian.
  [[nodiscard]] ParameterTrend with(const Eigen::VectorXd& covariate, Eigen::Index column) const;

 private:
  const PredictionTask* task_;
  Eigen::Index outputs_;
  const PredictionFit* fit_;
  Eigen::MatrixXd basis_;  // of the Jacobian's columns
};

// The parameter of each law that changes most, by z: with time, and at a place of the machine with
// position and speed. `motion`: samples x (positions, velocities). Positions count where one is
// measured.
[[nodiscard]] std::vector<LawTrend> law_trends(const PredictionTask& task, Eigen::Index outputs,
                                               const PredictionFit& fit,
                                               const Eigen::MatrixXd& motion,
                                               std::span<const Hypothesis> hypotheses);

}  // namespace graybox
