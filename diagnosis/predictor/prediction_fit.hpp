// Fit of an extended lumped model by its prediction errors: least squares by Levenberg and
// Marquardt over the free parameters, and, in free run, the initial states.
//
//   cost(theta) = sum over counted samples k and outputs j of (e_kj(theta) / s_j)^2,
//
// s_j the rms that the present model leaves in output j (a common scale: outputs of different units
// weigh alike). The gain K is that of the model where the fit starts. Derivatives are forward
// differences of whole passes, a column a pass, columns in parallel: right for laws of any kind,
// delays and set-valued friction too. In free run a fit that has settled goes on with central
// differences. There a step of a mass adds up to a phase, and what is left of two columns that
// nearly cancel is less than what a forward difference is off by.
//
//   PredictionFitter fitter(data, task, intensity, threads);
//   PredictionFit fit = fitter.fit(model, weights, {});
//
// Results do not depend on the number of threads. Cost: iterations x (1 + parameters) passes.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

#include "diagnosis/predictor/extended_lumped_model.hpp"
#include "diagnosis/predictor/prediction_data.hpp"
#include "diagnosis/predictor/stationary_gain.hpp"

namespace graybox {

// By run of the task.
using InitialStates = std::vector<Eigen::VectorXd>;

struct PredictionFit {
  bool usable = false;  // the model's motion stays within bounds
  ExtendedLumpedModel model;
  double cost = std::numeric_limits<double>::infinity();
  Eigen::VectorXd
      residuals;  // weighted; run by run, sample by sample, output by output; 0: not counted
  Eigen::MatrixXd jacobian;  // by the coordinates of the free parameters, then the initial states
  std::vector<std::size_t> free;
  InitialStates initials;
  Eigen::MatrixXd gain;          // empty in free run
  std::vector<bool> at_bound;    // of each free parameter
  BlockEdges edges, fine_edges;  // of the residuals
  [[nodiscard]] Eigen::Index initial_columns() const {
    return jacobian.cols() - static_cast<Eigen::Index>(free.size());
  }
};

// z of the richer fit over the poorer one, by blocks left out (left_out_blocks.hpp).
[[nodiscard]] double z_between(const PredictionFit& poorer, const PredictionFit& richer);
// Where the richer is the poorer with a law more: the larger of that and added_z(), by which a law
// that acts in a few blocks only is seen too.
[[nodiscard]] double z_as_given(const PredictionFit& poorer, const PredictionFit& richer);

class PredictionFitter {
 public:
  // `intensity` of the force noise (stationary_gain.hpp), not used in free run; a disturbance that
  // the filter follows. References are kept.
  PredictionFitter(const PredictionData& data, const PredictionTask& task, double intensity,
                   int threads, const DisturbanceForce& disturbance = {});

  [[nodiscard]] const PredictionData& data() const { return *data_; }
  [[nodiscard]] const PredictionTask& task() const { return *task_; }
  [[nodiscard]] int threads() const { return threads_; }
  // As the outputs say, less what the model's sensors are off by.
  [[nodiscard]] InitialStates measured_initials(const LumpedModel& model) const;
  // `initials` empty: measured. Throws Stopped where the process is asked to stop.
  [[nodiscard]] PredictionFit fit(const ExtendedLumpedModel& start, const Eigen::VectorXd& weights,
                                  const InitialStates& initials, int iterations,
                                  bool parameters_too = true) const;
  // A fit that goes on where another ended, with its gain.
  [[nodiscard]] PredictionFit fit_on(const PredictionFit& from, const Eigen::VectorXd& weights,
                                     int iterations) const;
  // The fit with derivatives that are the median of three steps: where a friction sticks or slips,
  // by less than the step, a sample may jump, and would seem to tell a parameter very well.
  [[nodiscard]] PredictionFit with_steady_slopes(const PredictionFit& fit,
                                                 const Eigen::VectorXd& weights) const;
  // False where the motion leaves all bounds.
  bool residuals(const ExtendedLumpedModel& model, const Eigen::VectorXd& weights,
                 const InitialStates& initials, const Eigen::MatrixXd& gain,
                 Eigen::VectorXd& result) const;
  // What the sensors' noise, and a disturbance, do to the predictions (stationary_gain.hpp). In
  // free run noise that is not stated is no more than the differences of the residuals say: fast
  // signals hide it in their own.
  [[nodiscard]] Eigen::VectorXd errors_by_noise(const PredictionFit& fit,
                                                const Eigen::VectorXd& weights,
                                                const DisturbanceForce& disturbance = {}) const;
  // q and q' of all coordinates, sample by sample over all runs.
  [[nodiscard]] Eigen::MatrixXd motion(const PredictionFit& fit) const;
  // rms of each output's errors over what counts, in its unit.
  [[nodiscard]] Eigen::VectorXd errors(const PredictionFit& fit,
                                       const Eigen::VectorXd& weights) const;

 private:
  [[nodiscard]] Predictor predictor_of(const ExtendedLumpedModel& model) const;
  struct Point {
    ExtendedLumpedModel model;
    InitialStates initials;
    Eigen::MatrixXd gain;
    double cost = 0.0;
    Eigen::VectorXd residuals;
  };
  [[nodiscard]] Eigen::MatrixXd gain_of(const ExtendedLumpedModel& model) const;
  bool evaluate(Point& point, const Eigen::VectorXd& weights) const;
  struct Runner;
  [[nodiscard]] Runner runner_of(const ExtendedLumpedModel& model) const;
  // Another gain where the model has other states than `given` is for.
  [[nodiscard]] Eigen::MatrixXd gain_for(const ExtendedLumpedModel& model,
                                         const Eigen::MatrixXd& given, Predictor& predictor) const;
  // False where the motion leaves all bounds. The errors, and the states, are the runner's.
  bool run_one(std::size_t r, const ExtendedLumpedModel& model, const InitialStates& initials,
               const Eigen::MatrixXd& gain, bool with_states, Runner& runner) const;
  void weigh(std::size_t r, const Eigen::MatrixXd& errors, const Eigen::VectorXd& weights,
             Eigen::Ref<Eigen::VectorXd> rows) const;
  // Where each run begins among the residuals, and how many these are.
  [[nodiscard]] std::vector<Eigen::Index> first_rows() const;
  void difference(const Point& at, std::span<const std::size_t> free,
                  const Eigen::VectorXd& weights, double share, Eigen::Index column,
                  std::optional<std::size_t> run, Eigen::MatrixXd& result) const;
  [[nodiscard]] PredictionFit fit_from(Point at, const Eigen::VectorXd& weights, int iterations,
                                       bool parameters_too) const;
  [[nodiscard]] Point moved(const Point& from, std::span<const std::size_t> free,
                            const Eigen::VectorXd& step) const;
  [[nodiscard]] double difference_step(const Point& at, std::span<const std::size_t> free,
                                       Eigen::Index column) const;
  [[nodiscard]] Eigen::MatrixXd jacobian(const Point& at, std::span<const std::size_t> free,
                                         const Eigen::VectorXd& weights, double share = 1.0) const;
  // Those whose parameters are not at a bound that they want to pass.
  [[nodiscard]] std::vector<Eigen::Index> active_columns(const Point& at,
                                                         const Eigen::VectorXd& slope,
                                                         PredictionFit& result) const;
  bool descend(Point& at, const Eigen::MatrixXd& jacobian, std::span<const Eigen::Index> active,
               std::span<const std::size_t> free, const Eigen::VectorXd& weights,
               double& damping) const;
  [[nodiscard]] Eigen::Index initial_columns(const Point& at) const;

  const PredictionData* data_;
  const PredictionTask* task_;
  double intensity_;
  int threads_;
  DisturbanceForce disturbance_;
};

}  // namespace graybox
