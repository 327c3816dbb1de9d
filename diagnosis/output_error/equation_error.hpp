// The equation error as a start for the output-error fit. Where every free mass is measured, the
// measured motion is imposed on the model and the force it takes compared with the recorded one,
//
//   M q'' + C q' + K q + sum b_out f(z, z', x)  against  B u,
//
// which is linear in masses, stiffness, damping and most laws, needs no start near the truth, and
// cannot drift away. Its price is noise in q, q', q''. All signals go through the same zero-phase
// low-pass filter first, and the estimate stays biased. As no filter fits all data, each of several
// cut-off frequencies gives a start; the output-error fit finds out which is good.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/output_error/output_error_problem.hpp"

namespace graybox {

struct EquationErrorEstimate {
  double frequency = 0.0;  // Hz, of the filter
  Eigen::VectorXd theta;
};

// None where some mass is not measured, samples are uneven, inputs pass through laws of actuators
// or outputs through those of sensors.
[[nodiscard]] std::vector<EquationErrorEstimate> equation_error_estimates(
    const OutputErrorProblem& problem);

}  // namespace graybox
