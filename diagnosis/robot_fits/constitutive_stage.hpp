// From a start far off to the neighbourhood of the maximum-likelihood estimate of a robot's
// stiffness.
//
// Minimises the error in the springs' constitutive relation (constitutive_residuals.hpp) for a
// descending sequence of relaxations tau. With tau = 0.1 violated springs explain most of it, and
// the misfit is smooth over decades of theta. Each later minimum starts where the one before ended.
// The smallest tau leaves theta near the optimum of the likelihood. Ceres (Levenberg and Marquardt)
// in log theta, with a normal prior about the start: parameters that these data hardly show stay
// near it.
//
// A misfit this smooth does not need every line: at most `lines` of each measurement, evenly
// picked, are used, in all positions.
//
//   FitSearchOptions search;
//   search.approach = [&](const Eigen::VectorXd& start) {
//     return constitutive_stage(robot, measurements, start);
//   };
//
// Cost: about 20 steps of Ceres, each some 0.1 ms for each position and line on one thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "diagnosis/response_fits/response_measurement.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

struct ConstitutiveStageOptions {
  std::vector<double> relaxations = {0.1, 0.01};  // tau, each positive
  double start_deviation = 1.0;                   // of log theta: the prior about the start
  std::size_t lines = 12;                         // of each measurement, at most
  int iteration_limit = 40;                       // for each relaxation
  int threads = 1;  // the result depends on it in the last digits only
};

// The theta where it ends; the last that could be evaluated where operating point or response cease
// to exist on the way. Throws InputError for options out of range.
[[nodiscard]] Eigen::VectorXd constitutive_stage(const RobotModel& robot,
                                                 std::span<const ResponseMeasurement> measurements,
                                                 const Eigen::VectorXd& start,
                                                 const ConstitutiveStageOptions& options = {});

}  // namespace graybox
