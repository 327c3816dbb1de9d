// One minimisation by Ceres: the error of an output-error problem over given stretches, from a
// given start. What fit_output_error and equation_error are made of.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "diagnosis/output_error/output_error_problem.hpp"

namespace graybox {

struct StretchFitOptions {
  bool free_parameters = true;
  bool free_initial = true;  // else held
  int iteration_limit = 100;
  double tolerance = 1e-9;  // relative decrease of the cost at which it ends
  std::function<bool()> keep_going{};
};

struct StretchFit {
  enum class Status { kConverged, kIterationLimit, kInterrupted, kDiverged };
  Status status = Status::kDiverged;
  Eigen::VectorXd theta;
  std::vector<Eigen::VectorXd> initial;  // of each stretch; empty: zero
  double cost = 0.0;                     // half the squared sum of whitened errors
  int iterations = 0;
};

// `deviation`: by which the error of each output is divided.
[[nodiscard]] StretchFit fit_stretches(const OutputErrorProblem& problem,
                                       std::span<const StretchOf> stretches,
                                       const Eigen::VectorXd& theta,
                                       std::vector<Eigen::VectorXd> initial,
                                       const Eigen::VectorXd& deviation,
                                       const StretchFitOptions& options);

// The cost at theta; infinite where the motion is.
[[nodiscard]] double stretch_cost(const OutputErrorProblem& problem,
                                  std::span<const StretchOf> stretches,
                                  const Eigen::VectorXd& theta,
                                  std::span<const Eigen::VectorXd> initial,
                                  const Eigen::VectorXd& deviation);

}  // namespace graybox
