// Parameters of a rigid robot in large motion from measured positions and torques. Inverse dynamics
// is linear in base parameters, so they are least squares away.
//
//   1. W(q, q', q'') at every sample of the estimation data (torque_columns.hpp)
//   2. base parameters of the model (base_parameters.hpp), then of these data: what the recorded
//      motion can't tell apart is regrouped too and named in `unseen`
//   3. weighted least squares, noise of each joint estimated (weighted_regression.hpp); parameters
//      listed under `refine`, in which the torque is not linear, by variable projection: the
//      residual of the linear fit as a function of them alone (Golub and Pereyra 1973), minimised
//      by Ceres from the values in the model file
//   4. the covariance of all of them together, from W and the slopes of W p
//   5. errors of every record, also of those the fit did not see
//
// Bias. W is computed from measured positions: noise in them shrinks the estimates, and in closed
// loop it is correlated with the torque's. Filtering the position well above the motion's bandwidth
// and well below the sampling rate keeps both small (Gautier, Janot and Vandanjon 2013).
//
//   const InverseDynamicsFit fit = fit_inverse_dynamics(robot, records);
//   fit.parameters[0].name, .value, .standard_error
//   fit.records[1].joints[1].nrmse
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "diagnosis/inverse_dynamics/weighted_regression.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

enum class InverseDynamicsStatus {
  kConverged,
  kNotConverged,  // the weights or the refinement did not settle: the last values are given
  kInterrupted,   // the same, by the caller
};
[[nodiscard]] const char* name_of(InverseDynamicsStatus status);

struct TorqueParameter {
  std::string name;
  std::string unit;
  double value = 0.0;
  double standard_error = 0.0;
  double start = std::numeric_limits<double>::quiet_NaN();  // of refined ones; else not a number
  bool is_refined = false;

  [[nodiscard]] double relative_error() const;  // standard_error / |value|
};

// Of one joint in one record, or of all joints together.
struct TorqueErrors {
  double relative = 0.0;                // 100 |error| / |torque|, %
  double nrmse = 0.0;                   // 100 rms(error) / std(torque), %
  double variance_accounted_for = 0.0;  // 100 (1 - var(error) / var(torque)), %
  double chi_square_per_sample = 0.0;   // mean of (error / noise)^2, noise that of the estimation
};

struct RecordErrors {
  std::string name;
  ExperimentRole role = ExperimentRole::kEstimation;
  Eigen::Index samples = 0;  // of each joint
  std::vector<TorqueErrors> joints;
  TorqueErrors total;  // joints stacked; the variances are sums over joints
};

struct InverseDynamicsFit {
  InverseDynamicsStatus status = InverseDynamicsStatus::kConverged;
  std::vector<TorqueParameter> parameters;  // base parameters, then refined ones
  Eigen::MatrixXd covariance;
  Eigen::VectorXd noise;                    // standard deviation of each joint's torque
  std::vector<std::string> relations;       // "XX2R = XX2 - YY2"
  std::vector<std::string> without_effect;  // parameters that no motion shows
  std::vector<std::string> unseen;          // what these recordings don't show, in words
  Eigen::Index structural_parameters = 0;   // base parameters of the model
  Eigen::Index samples = 0, degrees_of_freedom = 0;
  Eigen::Index lags = 0;    // of the covariance (weighted_regression.hpp)
  double condition = 0.0;   // of the scaled, weighted columns
  double chi_square = 0.0;  // sum of (error / noise)^2 over the estimation data
  std::vector<RecordErrors> records;
  RigidRobotModel robot;  // with the refined values
};

struct InverseDynamicsOptions {
  JointNoise noise = JointNoise::kEach;
  // Above 1, torque and columns are low-passed alike (zero phase, order 4, at 0.4/decimation of the
  // sample rate). Every decimation-th sample is kept (the parallel filter of Gautier 1997).
  int decimation = 1;
  int max_refinement_steps = 100;
  std::function<bool()> keep_going = {};  // asked now and then; empty: always
};

// A robot of which everything is known is not fitted: its errors are reported. Throws InputError
// where nothing unknown has an effect in the data, and for irregular samples or pieces too short to
// decimate. It also does for fewer samples than parameters, no torque at all, and elements whose
// force is not a number at its start.
[[nodiscard]] InverseDynamicsFit fit_inverse_dynamics(const RigidRobotModel& robot,
                                                      const std::vector<MotionRecord>& records,
                                                      const InverseDynamicsOptions& options = {});

}  // namespace graybox
