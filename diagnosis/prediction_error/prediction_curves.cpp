#include "diagnosis/prediction_error/prediction_curves.hpp"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

namespace graybox {

using Eigen::Index;

void add_prediction_curves(const PredictionData& data, const PredictionTask& task,
                           const PredictionFit& fit, const Eigen::VectorXd& weights,
                           const std::string& how, bool held_out,
                           std::vector<ResidualCurve>& curves) {
  const Index outputs = data.output_count();
  std::size_t recordings = shown_recordings(outputs);
  Index row = 0;
  for (const PredictionRun& run : task.runs) {
    if (recordings-- == 0) return;
    const OutputErrorRecording& recording = data.recording(run.recording);
    for (Index j = 0; j < outputs; ++j) {
      const auto at = static_cast<std::size_t>(j);
      ResidualCurve curve;
      curve.channel = fit.model.model.output_names[at];
      curve.unit = fit.model.model.output_units[at];
      curve.experiment = recording.name;
      curve.predicted_how = how;
      curve.over_time = true;
      curve.held_out = held_out;
      const Eigen::VectorXd measured = recording.outputs.col(j);
      curve.axis.assign(recording.time.begin(), recording.time.end());
      curve.measured.assign(measured.begin(), measured.end());
      curve.residual.assign(curve.measured.size(), std::numeric_limits<double>::quiet_NaN());
      for (Index k = 0; k < run.samples; ++k) {
        if (!run.counts(k)) continue;
        curve.residual[static_cast<std::size_t>(k)] =
            fit.residuals((row + k) * outputs + j) * weights(j);
      }
      curves.push_back(std::move(curve));
    }
    row += run.samples;
  }
}

}  // namespace graybox
