// Variable projection: the parameters theta in which the torque is not linear are found by Ceres.
// It works on the residual of the linear fit r(theta) = S^-1/2 (y - W(theta) p(theta)). There
// p(theta) is the weighted least squares of weighted_regression.hpp for fixed noise (Golub and
// Pereyra 1973). Positive parameters move by their logarithm, within a factor of 1000 of their
// start; others on the scale of their start.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "problems/laws/law_catalogue.hpp"

namespace graybox {

struct RefinementResult {
  Eigen::VectorXd values;
  std::vector<bool> at_limit;  // ran to the factor of 1000: the data don't determine it
  bool converged = false;
  bool interrupted = false;
};

// Residuals of the linear fit at theta and, where it is not null, their derivatives; false where
// there are none. `tolerance`: relative, of the squared sum and of a step.
using ProjectedResiduals = std::function<bool(
    const Eigen::VectorXd& theta, Eigen::VectorXd& residuals, Eigen::MatrixXd* jacobian)>;

[[nodiscard]] RefinementResult refine_parameters(const Eigen::VectorXd& start,
                                                 const std::vector<ParameterRange>& ranges,
                                                 const ProjectedResiduals& residuals, int max_steps,
                                                 double tolerance,
                                                 const std::function<bool()>& keep_going);

// The same by central differences. `residuals`: of the linear fit at theta; their number stays the
// same. `keep_going` as in inverse_dynamics_fit.hpp.
[[nodiscard]] RefinementResult refine_parameters(
    const Eigen::VectorXd& start, const std::vector<ParameterRange>& ranges,
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& residuals, int max_steps,
    const std::function<bool()>& keep_going);

}  // namespace graybox
