// What a diagnosis by prediction error shows along time: each output as measured, and what the
// model leaves of it. Samples that do not count are left out.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

// Adds the curves of the first recordings of a task. The weights are those of the fit's residuals.
// The words `how` say what is predicted. Residuals are NaN where nothing is.
void add_prediction_curves(const PredictionData& data, const PredictionTask& task,
                           const PredictionFit& fit, const Eigen::VectorXd& weights,
                           const std::string& how, bool held_out,
                           std::vector<ResidualCurve>& curves);

}  // namespace graybox
