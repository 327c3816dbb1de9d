// The column that drives a machine of one mass or two. It is a force, a current, a command, or the
// goal of a servo. Its unit may be odd, and its numbers may wrap.
#pragma once

#include "diagnosis/proposal/mass_machine.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

// Sets drive, likely_drive, drive_period, drive_wrap and open of a machine whose columns are known.
// Throws InputError where no column can be a drive or a motion.
void find_drive(MassMachine& machine, ModelProposal& proposal);

}  // namespace graybox
