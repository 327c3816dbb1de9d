// The covariance of an output-error estimate: white and robust (output_error_fit.hpp), and what
// the data do not see.
#pragma once

#include <Eigen/Core>
#include <span>

#include "diagnosis/estimation/identifiability.hpp"
#include "diagnosis/output_error/output_error_problem.hpp"

namespace graybox {

struct OutputErrorCovariance {
  Eigen::MatrixXd white, robust;    // empty where J has not full rank
  Identifiability identifiability;  // by the robust covariance, or by J^T J where there is none
  double lag_one_correlation = 0.0;
};

// The `runs` are simulated with derivatives by theta and the initial states (if `initial_is_free`),
// one for each stretch. The `deviation` is sigma of each output. The `variance` is that of the
// whitened residuals, 1 where sigma is stated.
[[nodiscard]] OutputErrorCovariance output_error_covariance(const OutputErrorProblem& problem,
                                                            std::span<const StretchOf> stretches,
                                                            std::span<const Simulated> runs,
                                                            const Eigen::VectorXd& theta,
                                                            const Eigen::VectorXd& deviation,
                                                            bool initial_is_free, double variance);

}  // namespace graybox
