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

// Sets speed_way of one mass whose measured velocity lost its sign, with a note. Such a velocity is
// of one sign in all logs and follows the size of a drive that has both (lost_sign.hpp).
void find_lost_speed_sign(MassMachine& machine, ModelProposal& proposal);

}  // namespace graybox
