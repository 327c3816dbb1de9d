// What the drives of a recording were before its first sample. A log often begins with the command
// that sets the machine off: then an actuator that follows late begins from nothing, and not from
// that command.
#pragma once

#include <Eigen/Core>

#include "diagnosis/output_error/output_error_problem.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {

// By input. A force that stays at its first value, while the machine at rest gets going late, was
// zero before; so it was where the recording reads rest (samples_at_rest) and it gets going at all.
// Any other input was what its first sample says. So were all inputs of a model with
// springs or weights, which hold a machine at rest against a force.
// Goes: from a twentieth of the rms speed or less to a third of it. Late: half of that time brings
// at most 0.42 of that speed (an even acceleration brings a half, a lag a quarter, a delay less),
// and it takes eight samples or more.
[[nodiscard]] Eigen::VectorXd drives_before(const LumpedModel& model,
                                            const OutputErrorRecording& recording);

// Samples with which a recording of one mass begins at rest; 0: it does not, or goes on where a
// part before ends. At rest its speed reads exactly zero, or its position four times the same. A
// counter that was just switched on reads zero, and goes on by a twentieth of its rms step or less.
[[nodiscard]] Eigen::Index samples_at_rest(const LumpedModel& model,
                                           const OutputErrorRecording& recording);

// Samples with which a recording of one mass begins at one speed; 0: it does not. Its drives stay
// for them, five samples or more and half of the recording at most, and its measured speed keeps
// within a twentieth of all that it covers.
[[nodiscard]] Eigen::Index samples_at_one_speed(const LumpedModel& model,
                                                const OutputErrorRecording& recording);

}  // namespace graybox
