// OutputErrorProblem: a lumped model and recordings of it, to be compared by simulation.
//
//   y(t_k; theta, y_0) - measured y_k,   its derivatives by the free parameters and the initial
//   state,
//
// for stretches of samples: whole recordings, or the windows of a first search. Simulated outputs
// and derivatives come together, in one pass (trajectory.hpp).
//
//   const OutputErrorProblem problem(model, load_output_error_data(model, campaign));
//   std::vector<Simulated> runs =
//       problem.simulate(problem.start(), problem.whole_recordings(), {});
//
// Derivatives are exact for the steps taken. How many steps a sample takes is the problem's
// `steps_per_sample`; step_error() compares with twice as many.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/output_error/trajectory.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {

// Consecutive samples of one experiment, channels in the model's order and units.
struct OutputErrorRecording {
  std::string name;  // of its file
  ExperimentRole role = ExperimentRole::kEstimation;
  Eigen::VectorXd time;     // s
  bool even = true;         // all steps alike
  Eigen::MatrixXd inputs;   // samples x inputs
  Eigen::MatrixXd outputs;  // samples x outputs
  // Samples x inputs, up to the first sample: those of the part before, where this is a part of a
  // file and begins where that ends. Else empty.
  Eigen::MatrixXd past_inputs = {};

  [[nodiscard]] Eigen::MatrixXd inputs_with_past() const;  // past_inputs above inputs
};

struct OutputErrorData {
  InputHold hold = InputHold::kZero;
  Eigen::VectorXd noise;  // standard deviation of each output; 0: not known
  std::vector<OutputErrorRecording> recordings;
  std::vector<std::string> remarks = {};  // what was changed in the recordings, file first
  Eigen::Index thinned_by = 1;            // one of so many recorded samples is here
};

// Inputs and outputs are the channels of these names. Throws InputError for a channel that is not
// there or in another unit, a recording that can't be used (experiment_recording.hpp) or has fewer
// than 10 samples, an imposed motion under a zero hold, a band-limited hold of irregular samples.
[[nodiscard]] OutputErrorData load_output_error_data(const LumpedModel& model,
                                                     const Campaign& campaign);

struct StretchOf {
  std::size_t recording = 0;
  Stretch stretch;
};

struct Simulated {
  bool finite = false;
  Rows outputs;  // samples * outputs rows: [value, parameters, initial state]
};

class OutputErrorProblem {
 public:
  // Throws InputError without an estimation recording.
  OutputErrorProblem(LumpedModel model, OutputErrorData data, int threads = 1);

  [[nodiscard]] const LumpedModel& model() const { return model_; }
  [[nodiscard]] const OutputErrorData& data() const { return data_; }
  [[nodiscard]] const std::vector<std::size_t>& free_parameters() const { return free_; }
  [[nodiscard]] Eigen::VectorXd start() const;  // the free parameters of the model
  [[nodiscard]] LumpedModel model_at(const Eigen::VectorXd& theta) const;
  [[nodiscard]] Eigen::Index initial_size() const { return initial_size_; }

  [[nodiscard]] int steps_per_sample() const { return steps_; }
  void set_steps_per_sample(int steps);

  [[nodiscard]] std::vector<StretchOf> whole_recordings(ExperimentRole role) const;
  // Windows of `samples` each, spread over the estimation recordings, about `total` samples in all.
  [[nodiscard]] std::vector<StretchOf> windows(Eigen::Index samples, Eigen::Index total) const;

  // q and q' of the free coordinates where a stretch begins, from measured outputs: measured where
  // they are, else as springs at rest would hold them, or zero.
  [[nodiscard]] Eigen::VectorXd measured_initial(const StretchOf& stretch) const;

  // One entry for each stretch; `initial`: for each stretch, or empty: zero. Derivatives if asked
  // for, by theta and, where `initial` is not empty, by it.
  void simulate(const Eigen::VectorXd& theta, std::span<const StretchOf> stretches,
                std::span<const Eigen::VectorXd> initial, bool with_derivatives,
                std::vector<Simulated>& result) const;

  // Largest change of an output, rms over its standard deviation, when steps are halved; infinite
  // where the simulation fails.
  [[nodiscard]] double step_error(const Eigen::VectorXd& theta,
                                  std::span<const StretchOf> stretches,
                                  std::span<const Eigen::VectorXd> initial) const;

  // Measured values in the order of Simulated::outputs.
  [[nodiscard]] Eigen::VectorXd measured(const StretchOf& stretch) const;
  // Standard deviation of each output over the estimation recordings: its scale.
  [[nodiscard]] const Eigen::VectorXd& output_scale() const { return output_scale_; }

 private:
  [[nodiscard]] NodeInputs nodes_of(std::size_t recording, const LumpedSystem& system,
                                    int steps) const;
  void simulate_with(int steps, const std::vector<NodeInputs>* nodes, const Eigen::VectorXd& theta,
                     std::span<const StretchOf> stretches, std::span<const Eigen::VectorXd> initial,
                     bool with_derivatives, std::vector<Simulated>& result) const;

  LumpedModel model_;
  OutputErrorData data_;
  int threads_;
  int steps_ = 1;
  std::vector<std::size_t> free_;
  Eigen::Index initial_size_ = 0;
  bool even_ = true;
  bool delays_vary_ = false;
  std::vector<NodeInputs> nodes_;  // of each recording, unless delays vary
  Eigen::VectorXd output_scale_;
};

}  // namespace graybox
