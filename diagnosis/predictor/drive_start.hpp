// What the drives of a recording were before its first sample. A log often begins with the command
// that sets the machine off: then an actuator that follows late begins from nothing, and not from
// that command.
#pragma once

#include <Eigen/Core>

#include "diagnosis/output_error/output_error_problem.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {

// By input. Zero for a force that stays at its first value while the machine, at rest at first,
// gets going: so large a force was not there before. Any other input is what its first sample
// says, as all are of a model with springs, which may hold a machine at rest against a force.
// Gets going: from a twentieth of the rms speed or less to a third of it or more.
[[nodiscard]] Eigen::VectorXd drives_before(const LumpedModel& model,
                                            const OutputErrorRecording& recording);

}  // namespace graybox
