// How a drive goes between its samples: held, as a controller holds its output, or evenly from one
// to the next, as a force or a current that was measured. A wrong guess is half a sample of time,
// and other laws then make up for it.
#pragma once

#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

struct HoldComparison {
  bool usable = false;
  double z = 0.0;            // of the other hold over the one stated
  Eigen::Index horizon = 0;  // samples
  double seconds = 0.0;
  double error = 0.0, error_other = 0.0;  // rms over the outputs, of their signals
};

// A model fitted to the same recordings under both, over the windows of a task. `data`
// and `other` differ in their hold alone. Cost: two fits.
[[nodiscard]] HoldComparison compare_holds(const PredictionData& data, const PredictionData& other,
                                           const ExtendedLumpedModel& model,
                                           const PredictionTask& task, double intensity,
                                           int threads);

}  // namespace graybox
