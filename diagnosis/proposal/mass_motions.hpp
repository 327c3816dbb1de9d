// The motions of a machine of one mass or two, and the side of the drive that each is on: by its
// title, else the driven one is that whose acceleration follows the force at once.
#pragma once

#include "diagnosis/log_columns/log_time.hpp"
#include "diagnosis/proposal/mass_machine.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

// Sets motion, motions and sides of a machine whose drive was looked for. Throws InputError where
// no column can be a motion, and where a unit contradicts what the user said.
void find_motions(MassMachine& machine, const LogTime& time, ModelProposal& proposal);

// Sets speed_way of one mass whose measured velocity never changes its sign, in no log, while the
// drive does and has its size (lost_sign.hpp, with their parts changed); with a note.
void find_lost_speed_sign(MassMachine& machine, ModelProposal& proposal);

}  // namespace graybox
