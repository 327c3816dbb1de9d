// One mass, or two with a spring between them, as a graybox-lumped/1 model (lumped_model.hpp).
//
// One mass needs the drive and one motion. Two masses need the motion of the driven one, and that
// of the other is used if it is there. Which side an encoder is on comes from its title, or from
// which of the two follows the force at once. Whether the second counts backwards, and the gear
// between them, come from how both move together.
#pragma once

#include <vector>

#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

// Throws InputError where no column can be motion or drive.
[[nodiscard]] ModelProposal propose_masses(const ProposalRequest& request,
                                           const std::vector<LogRecording>& recordings);

}  // namespace graybox
