// model.yaml of a machine of one mass or two, with start values from its log where no question is
// open (one_mass_start.hpp, start_values.hpp).
#pragma once

#include <string>

#include "diagnosis/log_columns/log_time.hpp"
#include "diagnosis/proposal/mass_machine.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

// Says its guesses and doubts in the proposal.
[[nodiscard]] std::string mass_model_text(const MassMachine& machine, const LogTime& time,
                                          ModelProposal& proposal);

}  // namespace graybox
