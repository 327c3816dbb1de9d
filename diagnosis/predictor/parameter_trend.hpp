// Whether a fitted parameter changes along the recordings: friction that fades as a machine warms
// up, a spring that sets.
//
// Beside theta let theta + a tau, tau the time within a recording about its middle, over the longest
// recording's length. To first order the residuals then move by a d, d = tau j, j the parameter's
// column of the Jacobian. With d beside the space of all columns (the parameters may take what they
// can of it),
//
//   a = -d'r / d'd,     z = a d'd / sqrt(sum over blocks of (d_b'(r_b + a d_b))^2).
//
// The blocks are those of left_out_blocks.hpp: residuals may have memory, and change in size (White,
// Econometrica 48, 1980). Cost: a QR of the Jacobian.
#pragma once

#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

struct ParameterTrend {
  double change = 0.0;  // a, in the coordinate of the Jacobian's column
  double z = 0.0;       // 0: the recordings do not tell
};

// Of the parameter in this column of the fit's Jacobian. `task`: that of the fit.
[[nodiscard]] ParameterTrend parameter_trend(const PredictionTask& task, Eigen::Index outputs,
                                             const PredictionFit& fit, Eigen::Index column);

}  // namespace graybox
