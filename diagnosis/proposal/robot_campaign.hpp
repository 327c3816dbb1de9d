// campaign.yaml of a robot: the channels of its joints, their filter, and what is kept out.
//
// Each joint of the chain has a channel of its force and one of its position. Forces whose unit is
// no newton (metre) get a gain that is not known, and so do forces that are far from what the links
// weigh.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/log_columns/logged_robot.hpp"
#include "diagnosis/proposal/campaign_draft.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

struct RobotCampaign {
  CampaignDraft draft;
  bool gains_known = true;  // of all drives
};

// The robot's chain and columns are chosen; `angle` is the unit of its positions. Guesses, notes
// and channels' columns are added to the proposal; questions that it has mark the first channel.
// Throws InputError for units that a column's quantity can't have.
[[nodiscard]] RobotCampaign draft_robot_campaign(const ProposalRequest& request,
                                                 const std::vector<LogRecording>& recordings,
                                                 const LoggedRobot& robot, const AngleUnit& angle,
                                                 const LogTime& time, ModelProposal& proposal);

// A channel's name of a joint: letters, digits and _.
[[nodiscard]] std::string joint_channel(const std::string& quantity, const std::string& joint);

}  // namespace graybox
