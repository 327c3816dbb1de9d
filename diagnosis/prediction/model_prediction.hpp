// How well a model predicts recordings as it stands: nothing is fitted.
//
//   lumped models    the outputs, some samples ahead and in free run (predictor.hpp); the initial
//                    state comes from what the predictor sees first
//   rigid robots     the forces, by inverse dynamics along the measured motion
//
// The error of a channel is its root mean square over the standard deviation of what was measured
// (NRMSE; docs/glossary.md). Samples that tell the state are not counted: in free run the first
// 200, at most half. A fit counts all.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/report/html_page.hpp"

namespace graybox {

struct PredictedChannel {
  std::string name, unit;
  // rms; infinite where the model's motion leaves all bounds, NaN where the recording is too short.
  double error = 0.0;
  double signal = 0.0;  // standard deviation of what was measured
  [[nodiscard]] double nrmse() const { return 100.0 * error / signal; }  // %
};

// One recording, one horizon.
struct RecordingPrediction {
  std::string recording;
  ExperimentRole role = ExperimentRole::kEstimation;
  double ahead = 0.0;  // s; 0: in free run, or forces at the measured motion
  std::vector<PredictedChannel> channels;
};

struct PredictionCurve {
  std::string recording, channel, unit;
  Eigen::VectorXd time, measured, predicted;  // s; NaN where nothing is predicted
};

// Where free runs of lumped models begin.
enum class FreeRunStart : std::int8_t {
  kMeasured,   // in the state that the first samples tell
  kEstimated,  // in that by which the whole recording is met best: models are compared so by hand,
               // and all samples count. The error is less than a prediction's.
};

struct ModelPrediction {
  std::string of;  // "outputs" or "forces"
  std::vector<RecordingPrediction> recordings;
  std::vector<PredictionCurve> curves;  // over the longest horizon
  std::vector<std::string> notes = {};  // what was changed in the recordings
  FreeRunStart start = FreeRunStart::kMeasured;
};

// graybox-lumped/1 and graybox-rigid-robot/1. Throws InputError for other formats, for files that
// can't be used together, and for a robot of which something is unknown. A robot's forces have no
// start to estimate.
[[nodiscard]] ModelPrediction predict_recordings(
    const std::filesystem::path& model, const Campaign& campaign,
    const std::vector<std::filesystem::path>& physics = {}, int threads = 1,
    FreeRunStart start = FreeRunStart::kMeasured);

// "0.1 s ahead", "free run", "at measured motion".
[[nodiscard]] std::string prediction_words(const ModelPrediction& prediction, double ahead);

// What the numbers are: "error (rms) over ...".
[[nodiscard]] std::string words_of_measure(const ModelPrediction& prediction);

// Measured and predicted, in the order of the recordings.
[[nodiscard]] std::vector<Trace> prediction_traces(const ModelPrediction& prediction);

// One page with the table and the traces (html_page.hpp).
[[nodiscard]] std::string prediction_page(const ModelPrediction& prediction,
                                          const std::string& model, const std::string& campaign,
                                          const PageOrigin& origin = {});

}  // namespace graybox
