// The campaign of a machine of one mass or two: its channels with their units, and what of the logs
// is fitted and what is kept out.
#pragma once

#include "diagnosis/proposal/campaign_draft.hpp"
#include "diagnosis/proposal/mass_machine.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

// Fills a draft whose times are known, and sets the machine's force_factor and goal_factor.
void draft_mass_campaign(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal);

// Sign and gear of the load's sensor from how both move.
void relate_encoders(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal);

}  // namespace graybox
