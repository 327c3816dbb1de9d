// A rigid robot of a URDF as a graybox-rigid-robot/1 model (rigid_robot_model.hpp).
//
// The chain goes from the link before the first joint whose position and force are logged to the
// link behind the last. Where joints of several branches are logged, the branch with most of them
// is taken. Other joints are locked where the log has them on average, or at zero, and gravity is
// turned into the first link's axes.
// Forces in newtons or newton metres are taken as such; of any other unit the drives' gains are
// unknown. Rotor inertias are unknown, as a URDF has none.
#pragma once

#include <vector>

#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

// Throws InputError where the URDF and the log share no joint, where a joint between logged ones is
// not logged, and where a logged link has no mass in the URDF.
[[nodiscard]] ModelProposal propose_robot(const ProposalRequest& request,
                                          const std::vector<LogRecording>& recordings);

}  // namespace graybox
