// The recordings of a diagnosis by prediction error, and from where a predictor looks ahead.
//
//   const PredictionData data(model, campaign);
//   const PredictionTask task = data.windows(10);         // ten samples ahead
//
// A task cuts recordings into windows of h samples. Each is forecast from a filter that has seen
// all samples before it. Samples before the first window do not count: the filter starts from
// nothing. h = 0 is the free run: everything counts, initial states are estimated.
//
// Windows in which every measured mass stands still do not count either (standing_samples). There
// friction holds against whatever acts up to its level, a disturbance too. A model that holds is
// right by no more than a level that is high enough.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "diagnosis/output_error/output_error_problem.hpp"
#include "diagnosis/predictor/drive_signals.hpp"
#include "diagnosis/predictor/left_out_blocks.hpp"
#include "diagnosis/predictor/predictor.hpp"

namespace graybox {

struct PredictionRun {
  std::size_t recording = 0;
  Eigen::Index samples = 0;             // from its first
  Eigen::Index first = 0, horizon = 0;  // Forecasts
  std::vector<std::uint8_t> standing;   // of each window, or empty
  [[nodiscard]] Forecasts forecasts() const {
    return {first, horizon, standing.empty() ? nullptr : &standing};
  }
  [[nodiscard]] bool counts(Eigen::Index sample) const {
    return sample >= first && (horizon == 0 || !forecasts().skips((sample - first) / horizon));
  }
  [[nodiscard]] Eigen::Index counted() const;
};

struct PredictionTask {
  Eigen::Index horizon = 0;  // samples ahead; 0: free run
  std::vector<PredictionRun> runs;
  [[nodiscard]] bool is_free() const { return horizon == 0; }
  [[nodiscard]] Eigen::Index rows(
      Eigen::Index outputs) const;             // samples times outputs, of all runs
  [[nodiscard]] Eigen::Index counted() const;  // samples
  // Edges of blocks for left_out_blocks.hpp: of whole windows; in free run runs cut evenly.
  [[nodiscard]] BlockEdges edges(Eigen::Index outputs,
                                 Eigen::Index most_blocks = kLeftOutBlocks) const;
};

inline constexpr Eigen::Index kFewestHorizonWindows = 10;                // of a horizon
inline constexpr Eigen::Index kFirstHorizon = 10, kShortestHorizon = 3;  // samples

// Whole windows of a horizon in a recording of so many samples, after those that the predictor
// sees.
[[nodiscard]] Eigen::Index whole_windows(Eigen::Index samples, Eigen::Index horizon);

// How many samples of the estimation recordings are wanted. More are thinned: every f-th sample of
// the outputs, and held between them the mean of what the inputs were. So nothing is lost of a
// force but its course within a thinned sample. That must be small, and the model's fastest mode
// slow. Recordings with inputs that are band-limited, or with imposed motion, are not thinned.
struct SampleLimit {
  Eigen::Index most = 0;  // 0: all samples
  double dropped = 0.3;   // of the inputs' rms may go with their course
  bool may_cut = true;    // what can't be thinned is cut to its first samples
};

// Recorded samples from which the state is told before a recording runs free: at most half of it.
inline constexpr Eigen::Index kSeenBeforeFreeRun = 200;
// The state of a recording of fewer than kShortRecording samples that begins at rest is told by the
// samples at rest, or by so many where these are fewer.
inline constexpr Eigen::Index kSeenAtRest = 2, kShortRecording = 2000;

class PredictionData {
 public:
  // Throws InputError for what load_output_error_data refuses and for times that are not even.
  PredictionData(const LumpedModel& model, const Campaign& campaign, int threads,
                 const SampleLimit& limit = {});

  // These recordings for a model of other values, thinned as it allows.
  [[nodiscard]] PredictionData for_model(const LumpedModel& model, int threads,
                                         const SampleLimit& limit) const;
  // These recordings with every output times its factor.
  [[nodiscard]] PredictionData with_factors(const LumpedModel& model,
                                            const Eigen::VectorXd& factors, int threads) const;

  [[nodiscard]] const OutputErrorRecording& recording(std::size_t index) const {
    return problem_.data().recordings[index];
  }
  [[nodiscard]] std::size_t recording_count() const { return problem_.data().recordings.size(); }
  [[nodiscard]] Eigen::Index output_count() const { return output_scale().size(); }
  [[nodiscard]] double sample_time() const { return sample_time_; }
  [[nodiscard]] double recorded_sample_time() const {  // before samples were thinned
    return sample_time_ / static_cast<double>(problem_.data().thinned_by);
  }
  [[nodiscard]] int steps_per_sample() const { return steps_; }
  [[nodiscard]] const RecordedNodes& nodes() const { return nodes_; }
  [[nodiscard]] InputHold hold() const { return problem_.data().hold; }
  // What was changed in the recordings.
  [[nodiscard]] const std::vector<std::string>& remarks() const { return problem_.data().remarks; }
  [[nodiscard]] std::span<const OutputErrorRecording> recordings() const {
    return problem_.data().recordings;
  }
  // rms of each output about its mean, over the recordings of the fit.
  [[nodiscard]] const Eigen::VectorXd& output_scale() const { return problem_.output_scale(); }
  // Standard deviation of the white noise of each output: stated, else from differences: of order m
  // of samples, rms / sqrt(binomial(2 m, m)), the least of m = 2 ... 8. Never below 1e-7 of the
  // scale.
  [[nodiscard]] const Eigen::VectorXd& noise() const { return noise_; }
  // Noise that is not stated is no larger than this of each output: where samples are far apart,
  // the differences that it is read from are of the motion.
  void limit_noise(const Eigen::VectorXd& most);
  // Whether an output's noise may be rounding, which follows the motion: of a position, and of what
  // often repeats its value.
  [[nodiscard]] bool is_rounded(Eigen::Index output) const {
    return rounded_[static_cast<std::size_t>(output)];
  }
  // The step of an output that is rounded, in its unit; 0: none is seen.
  [[nodiscard]] double rounding_step(Eigen::Index output) const {
    return steps_of_outputs_[static_cast<std::size_t>(output)];
  }
  [[nodiscard]] bool states_noise(Eigen::Index output) const {
    return stated_[static_cast<std::size_t>(output)];
  }
  // rms, and the largest, of the forces that act or that outputs measure. Where none does, of what
  // moves the masses: mass times acceleration.
  [[nodiscard]] double force_scale() const { return force_scale_; }
  [[nodiscard]] double largest_force() const { return largest_force_; }
  // Whether no force is recorded, or all are zero throughout: then the motion tells ratios of
  // forces to masses alone.
  [[nodiscard]] bool moves_freely() const { return moves_freely_; }
  [[nodiscard]] Eigen::VectorXd measured_initial(std::size_t recording) const;
  // How far a velocity and a position of the free coordinates may be off at the start: their steps.
  [[nodiscard]] Eigen::Index shortest() const;  // samples, of the estimation recordings
  [[nodiscard]] bool has_validation() const;
  // rms of the inputs where they are kept out, over that of the fit; the largest.
  [[nodiscard]] double growth_of_inputs() const;
  // Whole windows of a horizon in the recordings of the fit.
  [[nodiscard]] Eigen::Index window_count(Eigen::Index horizon) const;
  // How far ahead a search begins: ten samples, or as many as leave ten windows, three at least.
  [[nodiscard]] Eigen::Index first_horizon() const;

  // The largest speed with which a recording may begin; infinite but for one mass that begins at
  // rest (drive_start.hpp) in a short recording.
  [[nodiscard]] double largest_first_speed(std::size_t recording) const {
    return largest_first_speeds_[recording];
  }

  // Free run after the first kSeenBeforeFreeRun recorded samples, which the predictor sees. A short
  // recording that begins at rest tells its state at once, and the run sees how it sets off.
  [[nodiscard]] PredictionTask free_after_start(ExperimentRole role) const;
  [[nodiscard]] PredictionTask windows(Eigen::Index horizon,
                                       ExperimentRole role = ExperimentRole::kEstimation) const;

 private:
  PredictionData(const LumpedModel& model, OutputErrorData data, int threads);
  void estimate_noise();
  void measure_force(const LumpedModel& model);
  void measure_inertial_force(const LumpedModel& model);

  OutputErrorProblem problem_;
  int steps_ = 1;
  double sample_time_ = 0.0;
  RecordedNodes nodes_;
  Eigen::VectorXd noise_;
  std::vector<bool> stated_;  // of each output's
  std::vector<bool> rounded_;
  std::vector<double> steps_of_outputs_;             // by which they are rounded
  std::vector<std::vector<std::uint8_t>> standing_;  // by recording: samples
  std::vector<Eigen::Index> rests_at_start_;         // likewise, with which it begins
  std::vector<double> largest_first_speeds_;
  bool moves_freely_ = false;
  double force_scale_ = 1.0, largest_force_ = std::numeric_limits<double>::quiet_NaN();
};

// Samples within a stretch of at least 30 in which no position output moves by more than one step
// of its encoder or four standard deviations of its noise, and every velocity output is within
// three of zero. Empty where neither is measured.
[[nodiscard]] std::vector<std::uint8_t> standing_samples(const LumpedModel& model,
                                                         const Eigen::MatrixXd& outputs,
                                                         const Eigen::VectorXd& noise);

// Standard deviation of white noise on a smooth signal, by its differences.
[[nodiscard]] double noise_by_differences(const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace graybox
