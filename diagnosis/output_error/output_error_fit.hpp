// The output-error fit of a lumped model to recordings of any signals: the parameters with which
// the simulated outputs (from the recorded inputs alone) come nearest to the measured ones,
//
//   theta_hat = arg min  sum_recordings sum_k sum_j ((y_j(t_k; theta, y_0) - y_jk) / sigma_j)^2,
//
// the maximum-likelihood estimate for white normal measurement noise (Ljung, System Identification,
// 1999, Section 7.2). By Ceres (Levenberg and Marquardt) with the exact derivatives of
// output_error_problem.hpp; parameters that must be positive are fitted by their logarithm, others
// within their bounds. The initial state of each recording is estimated along, unless it is known.
// sigma_j: as stated, or the rms of the residuals (one output: of no matter to theta).
//
// Getting there. A free run forgives no bad start: a wrong resonance leaves one period behind, a
// wrong friction lets an axis drift away. Therefore
//   1. the equation error (equation_error.hpp), where all masses are measured, gives starts from
//      the data alone; the model's own values and values off by up to `start_spread` either way are
//      further ones; where all motion is imposed, the parameters that are linear there go to their
//      optimum first (linear_start.hpp);
//   2. the starts with the least error over short windows, each from its own initial state
//      (multiple shooting without its constraints), are fitted to these windows;
//   3. the best go on to whole recordings; where a whole run still diverges, over longer windows.
//
// Covariance. With J the whitened derivatives less what initial states explain, and r the
// residuals,
//   white   (J^T J)^-1, times the residual's variance if sigma is not stated
//   robust  (J^T J)^-1 V (J^T J)^-1, V = sum_l w_l sum_t J_t^T r_t r_(t+l)^T J_(t+l): the sandwich
//           of Newey and West (Econometrica 55, 1987), Bartlett weights w_l, lags by the rule of
//           Andrews (Econometrica 59, 1991, (6.2) and (6.4)), scores whitened first (Andrews and
//           Monahan, Econometrica 60, 1992).
// Residuals of real recordings are not white: the robust one is what is reported. From three
// recordings on it is widened by the spread between them (recording_spread.hpp), and where what is
// left drifts (lag-one correlation above 0.5) by that between eight batches of samples.
//
//   const OutputErrorFit fit = fit_output_error(problem);
//   if (fit.status == OutputErrorStatus::kConverged) use(fit.theta, fit.covariance);
//
// Cost of one simulation with derivatives: O(samples x steps a sample x (parameters + initial
// state) x state^2); the fit takes 10 to 200 of them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/estimation/identifiability.hpp"
#include "diagnosis/output_error/output_error_problem.hpp"

namespace graybox {

enum class InitialState : std::int8_t {
  kFree,      // estimated, for each recording
  kMeasured,  // the first measured values (OutputErrorProblem::measured_initial)
  kRest,      // zero
};

struct OutputErrorOptions {
  InitialState initial_state = InitialState::kFree;
  bool equation_error = true;
  int starts = 8;             // random ones, beside the model's own and the equation error's
  double start_spread = 3.0;  // their values are off by up to this factor
  int window_fits = 4;        // of the starts, those with the least error
  std::uint64_t seed = 1;
  int iteration_limit = 100;  // of Ceres
  // Steps are halved until that changes no output by more than this part of its deviation (rms).
  double step_tolerance = 1e-4;
  int step_limit = 64;  // a sample
  // Samples at the beginning of a validation recording that its initial state is estimated from.
  Eigen::Index initial_samples = 200;
  std::function<bool()> keep_going{};  // asked at every iteration; false stops with the best so far
};

enum class OutputErrorStatus : std::int8_t {
  kConverged = 0,
  kIterationLimit = -1,  // theta is the last
  kUnidentifiable = -2,  // the data do not see some combination of parameters: no covariance
  kDiverged = -3,        // no start gave a motion that stays finite
  kStepLimit = -4,       // more steps than allowed would be needed: too stiff
  kInterrupted = -5,
};
[[nodiscard]] std::string_view to_string(OutputErrorStatus status);

// How well the outputs of a set of recordings are simulated.
struct OutputErrorScore {
  std::string name;  // of the recording's file
  ExperimentRole role = ExperimentRole::kEstimation;
  bool finite = false;
  Eigen::VectorXd rms;                     // of the error, by output
  Eigen::VectorXd deviation;               // standard deviation of the error: rms without its mean
  Eigen::VectorXd nrmse;                   // %, 100 rms / standard deviation of the measured signal
  Eigen::VectorXd variance_accounted_for;  // %, 100 (1 - var error / var measured)
};

struct OutputErrorStart {
  std::string origin{};  // "model", "equation error at 50 Hz", "random"
  Eigen::VectorXd theta;
  double cost = 0.0;      // over the windows, before
  double fitted = 0.0;    // and after the fit to windows; 0: not tried
  Eigen::VectorXd end{};  // of that fit
  // Of an equation error's estimate: how well it simulates whole recordings, unfitted.
  OutputErrorScore estimation{}, validation{};
};

struct OutputErrorFit {
  OutputErrorStatus status = OutputErrorStatus::kDiverged;
  Eigen::VectorXd theta;                 // the free parameters
  std::vector<std::size_t> free;         // which of the model's they are
  LumpedModel model;                     // with theta
  std::vector<Eigen::VectorXd> initial;  // of each estimation recording
  Eigen::MatrixXd covariance;            // robust; empty where unidentifiable or not converged
  Eigen::MatrixXd white_covariance;
  Eigen::VectorXd noise;  // sigma of each output
  bool noise_is_known = false;
  double chi_square = 0.0;
  std::size_t degrees_of_freedom = 0;
  double lag_one_correlation = 0.0;  // of the residuals: 0 for white ones
  Identifiability identifiability;
  std::vector<OutputErrorStart> starts;
  std::vector<OutputErrorScore> scores;     // of every recording
  OutputErrorScore estimation, validation;  // over all recordings of a role
  int iterations = 0;
  int steps_per_sample = 0;
  double step_error = 0.0;

  [[nodiscard]] Eigen::VectorXd standard_errors() const;
};

// Changes the problem's steps per sample. Throws InputError for a model without free parameters and
// fewer measured numbers than these.
[[nodiscard]] OutputErrorFit fit_output_error(OutputErrorProblem& problem,
                                              const OutputErrorOptions& options = {});

}  // namespace graybox
