#include "diagnosis/proposal/mass_proposal.hpp"

#include <algorithm>

#include "diagnosis/log_columns/even_samples.hpp"
#include "diagnosis/proposal/campaign_draft.hpp"
#include "diagnosis/proposal/mass_campaign.hpp"
#include "diagnosis/proposal/mass_drive.hpp"
#include "diagnosis/proposal/mass_machine.hpp"
#include "diagnosis/proposal/mass_model.hpp"
#include "diagnosis/proposal/mass_motions.hpp"
#include "diagnosis/proposal/mass_times.hpp"

namespace graybox {
namespace {

bool moves(const LogRecording& recording) {
  return std::ranges::any_of(recording.columns, [](const LogColumn& column) {
    const LogQuantity quantity = column.words.quantity;
    return (quantity == LogQuantity::kPosition || quantity == LogQuantity::kVelocity) &&
           column.values.maxCoeff() > column.values.minCoeff();
  });
}

// A log that stands still tells no units and no start: the first that moves comes before it.
std::vector<LogRecording> with_motion_first(std::vector<LogRecording> recordings) {
  const auto first = std::ranges::find_if(recordings, moves);
  if (first != recordings.end()) std::rotate(recordings.begin(), first, first + 1);
  return recordings;
}

}  // namespace

ModelProposal propose_masses(const ProposalRequest& request,
                             const std::vector<LogRecording>& logs) {
  std::vector<LogRecording> reordered;  // a copy only where it is needed: logs may be large
  if (!moves(logs.front())) reordered = with_motion_first(logs);
  const std::vector<LogRecording>& recordings = reordered.empty() ? logs : reordered;
  MassMachine machine(request, recordings);
  CampaignDraft draft;
  ModelProposal proposal;
  add_guess(proposal, "model", machine.has_two ? "two masses and a spring" : "one mass",
            request.machine_reason);
  find_times(machine, draft, proposal);
  find_drive(machine, proposal);
  find_motions(machine, draft.time, proposal);
  find_lost_speed_sign(machine, proposal);
  take_held_values(machine, draft, proposal);
  machine.even = EvenSamples(machine.log, draft.time);
  draft_mass_campaign(machine, draft, proposal);
  if (proposal.questions.empty()) relate_encoders(machine, draft, proposal);
  proposal.model_text = mass_model_text(machine, draft.time, proposal);
  proposal.campaign_text = campaign_text(draft, recordings, request.folder);
  return proposal;
}

}  // namespace graybox
