// A better start where all motion is imposed. Then laws answer a motion that no parameter changes,
// and what is measured is linear in their sizes (LawParameter::is_linear), in inertia, springs and
// dampers: with the other parameters where they are, these have one optimum, which least squares
// find. Sizes off by orders would else pull the search for play, levels and exponents into other
// optima.
#pragma once

#include <Eigen/Core>

#include "diagnosis/output_error/output_error_problem.hpp"

namespace graybox {

// theta with these parameters at their optimum over the estimation recordings; theta itself where
// some motion is free, nothing is linear, or that optimum is out of a parameter's range.
// `deviation`: by which the error of each output is divided. One simulation with derivatives.
[[nodiscard]] Eigen::VectorXd with_linear_optimum(const OutputErrorProblem& problem,
                                                  const Eigen::VectorXd& theta,
                                                  const Eigen::VectorXd& deviation);

}  // namespace graybox
