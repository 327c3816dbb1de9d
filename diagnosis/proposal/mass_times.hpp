// When the samples of a log of one mass or two were taken, and which of them are values of their
// own: a signal may be logged more often than it is measured.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/log_columns/log_time.hpp"
#include "diagnosis/proposal/campaign_draft.hpp"
#include "diagnosis/proposal/mass_machine.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

// The times, and the machine's columns, which are all others.
void find_times(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal);

// Where the motion was measured at a slower rate than logged one of so many samples is taken. What
// drives is held between samples or goes on, as it was measured.
void take_held_values(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal);

// Where in a segment of a recording the motion's values begin.
[[nodiscard]] Eigen::Index first_of_held(const MassMachine& machine, const LogTime& time,
                                         const DraftExperiment& experiment);

// Stamps that jitter while the position does not: resampling by them would make the motion rough.
void note_arrival_times(const MassMachine& machine, const LogTime& time,
                        std::vector<std::string>& notes);

// Rows so rare that most samples would be interpolated between them.
void note_sparse_rows(const CampaignDraft& draft, const LogRecording& log,
                      std::vector<std::string>& notes);

}  // namespace graybox
