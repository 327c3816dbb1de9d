#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/prediction/kinds.hpp"
#include "diagnosis/prediction_error/search_start.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kStartIterations = 50;

VectorXd deviations_of(const MatrixXd& values) {
  const MatrixXd centred = values.rowwise() - values.colwise().mean();
  return (centred.colwise().squaredNorm() / static_cast<double>(values.rows())).cwiseSqrt();
}

class OutputPrediction {
 public:
  OutputPrediction(const LumpedModel& model, const Campaign& campaign, int threads,
                   FreeRunStart start)
      : model_(as_given(model, kSearchFactor)), data_(model, campaign, threads), threads_(threads) {
    result_.start = start;
    intensity_ = start_intensity(model_, data_, threads);
  }

  ModelPrediction run() {
    result_.of = "outputs";
    result_.notes = data_.remarks();
    for (Index horizon = data_.first_horizon();
         data_.window_count(horizon) >= kFewestHorizonWindows; horizon *= 10) {
      add(horizon, false);
      if (data_.window_count(3 * horizon) >= kFewestHorizonWindows) add(3 * horizon, false);
    }
    add(0, true);
    return std::move(result_);
  }

 private:
  [[nodiscard]] PredictionTask task_of(Index horizon, ExperimentRole role) const {
    const bool has_seen = horizon == 0 && result_.start == FreeRunStart::kMeasured;
    return has_seen ? data_.free_after_start(role) : data_.windows(horizon, role);
  }
  // Of the initial state alone, where it is estimated: the parameters stay.
  [[nodiscard]] PredictionFit fit(const PredictionTask& task) const {
    const PredictionFitter fitter(data_, task, intensity_, threads_);
    return fitter.fit(model_, data_.output_scale(), {}, task.is_free() ? kStartIterations : 0,
                      false);
  }

  void add(Index horizon, bool with_curves) {
    for (const ExperimentRole role : {ExperimentRole::kEstimation, ExperimentRole::kValidation}) {
      for (const PredictionRun& run : task_of(horizon, role).runs) {
        PredictionTask one;
        // Of horizon 0 is what runs free from its first sample on.
        const bool has_seen = horizon == 0 && result_.start == FreeRunStart::kMeasured;
        one.horizon = has_seen ? run.samples : horizon;
        one.runs.push_back(run);
        add_run(one, horizon, with_curves);
      }
    }
  }

  void add_run(const PredictionTask& task, Index horizon, bool with_curves) {
    const PredictionRun& run = task.runs.front();
    const OutputErrorRecording& recording = data_.recording(run.recording);
    const bool is_long_enough = run.counted() > 0;
    const PredictionFit run_fit = fit(task);
    VectorXd errors =
        VectorXd::Constant(data_.output_count(), std::numeric_limits<double>::infinity());
    if (!is_long_enough) {
      errors.setConstant(std::numeric_limits<double>::quiet_NaN());
    } else if (run_fit.usable) {
      errors =
          PredictionFitter(data_, task, intensity_, threads_).errors(run_fit, data_.output_scale());
    }
    const VectorXd signal = deviations_of(recording.outputs);
    RecordingPrediction prediction{
        recording.name, recording.role, data_.sample_time() * static_cast<double>(horizon), {}};
    for (Index j = 0; j < errors.size(); ++j) {
      const auto at = static_cast<std::size_t>(j);
      prediction.channels.push_back(
          {model_.model.output_names[at], model_.model.output_units[at], errors(j), signal(j)});
    }
    result_.recordings.push_back(std::move(prediction));
    if (with_curves && run_fit.usable) add_curves(run_fit, run, recording);
  }

  void add_curves(const PredictionFit& fit, const PredictionRun& run,
                  const OutputErrorRecording& recording) {
    const Index outputs = data_.output_count();
    for (Index j = 0; j < outputs; ++j) {
      const auto at = static_cast<std::size_t>(j);
      PredictionCurve curve{
          recording.name, model_.model.output_names[at], model_.model.output_units[at],
          recording.time, recording.outputs.col(j),      recording.outputs.col(j)};
      for (Index k = 0; k < run.samples; ++k) {
        curve.predicted(k) = run.counts(k) ? curve.measured(k) - fit.residuals(k * outputs + j) *
                                                                     data_.output_scale()(j)
                                           : std::numeric_limits<double>::quiet_NaN();
      }
      result_.curves.push_back(std::move(curve));
    }
  }

  ExtendedLumpedModel model_;
  PredictionData data_;
  int threads_;
  double intensity_ = 0.0;
  ModelPrediction result_;
};

}  // namespace

ModelPrediction predict_outputs(const LumpedModel& model, const Campaign& campaign, int threads,
                                FreeRunStart start) {
  return OutputPrediction(model, campaign, threads, start).run();
}

}  // namespace graybox
