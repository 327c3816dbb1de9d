#include "diagnosis/robot_fits/constitutive_stage.hpp"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <algorithm>
#include <cstddef>

#include "diagnosis/estimation/quiet_ceres.hpp"
#include "diagnosis/estimation/stop_when_asked.hpp"
#include "diagnosis/robot_fits/constitutive_residuals.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr double kTolerance = 1e-4;  // relative decrease of the cost: what follows needs no more

ResponseMeasurement thinned(const ResponseMeasurement& data, std::size_t lines) {
  const std::size_t count = data.frequencies.size();
  if (count <= lines) return data;
  ResponseMeasurement few{data.position, data.experiments, {}, {}, {}};
  for (std::size_t i = 0; i < lines; ++i) {
    const std::size_t f = (2 * i + 1) * count / (2 * lines);
    few.frequencies.push_back(data.frequencies[f]);
    few.responses.push_back(data.responses[f]);
    if (!data.noise.empty()) few.noise.push_back(data.noise[f]);
  }
  return few;
}

// False where the model can't be evaluated; theta is then what it was.
bool minimise(const RobotModel& robot, const std::vector<ResponseMeasurement>& measurements,
              const Eigen::VectorXd& start, double relaxation,
              const ConstitutiveStageOptions& options, Eigen::VectorXd& theta) {
  Eigen::VectorXd parameters = theta.array().log();
  ceres::Problem problem;
  try {
    for (const ResponseMeasurement& measurement : measurements) {
      problem.AddResidualBlock(new ConstitutiveResiduals(robot, measurement, theta, relaxation),
                               nullptr, parameters.data());
    }
  } catch (const InputError&) {
    return false;
  }
  const Eigen::MatrixXd root =
      Eigen::MatrixXd::Identity(start.size(), start.size()) / options.start_deviation;
  problem.AddResidualBlock(new ceres::NormalPrior(root, start.array().log()), nullptr,
                           parameters.data());
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  solver.num_threads = options.threads;
  solver.logging_type = ceres::SILENT;
  solver.max_num_iterations = options.iteration_limit;
  solver.function_tolerance = kTolerance;
  StopWhenAsked stop;
  solver.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  silence_ceres();
  ceres::Solve(solver, &problem, &summary);
  const Eigen::VectorXd end = parameters.array().exp();
  if (!summary.IsSolutionUsable() || !end.allFinite()) return false;
  theta = end;
  return true;
}

}  // namespace

Eigen::VectorXd constitutive_stage(const RobotModel& robot,
                                   std::span<const ResponseMeasurement> measurements,
                                   const Eigen::VectorXd& start,
                                   const ConstitutiveStageOptions& options) {
  const bool positive = std::ranges::all_of(options.relaxations, [](double t) { return t > 0.0; });
  if (!positive || !(options.start_deviation > 0.0) || options.lines < 1 ||
      options.iteration_limit < 1 || options.threads < 1) {
    throw InputError(
        "constitutive stage: relaxations, start_deviation, lines, iteration_limit and threads must "
        "be positive");
  }
  std::vector<ResponseMeasurement> few;
  for (const ResponseMeasurement& each : measurements) few.push_back(thinned(each, options.lines));
  Eigen::VectorXd theta = start;
  for (const double relaxation : options.relaxations) {
    if (!minimise(robot, few, start, relaxation, options, theta)) break;
  }
  return theta;
}

}  // namespace graybox
