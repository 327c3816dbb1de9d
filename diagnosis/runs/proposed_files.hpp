// The files that a proposal leads to: model.yaml and campaign.yaml in the folder of the request.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

// Throws InputError where one of the files is there already.
void refuse_existing_proposal(const ProposalRequest& request);

// Writes both files. Where no question is open the recordings are read by them, as a diagnosis
// does. What that would refuse is refused here, and nothing is written. Warnings are handed back.
// Forces of a robot against which joints would gain energy by friction are then reversed, which the
// proposal says among its guesses. Throws InputError.
std::vector<std::string> write_proposal(ProposalRequest& request, ModelProposal& proposal);

}  // namespace graybox
