// The set `any_motion` of the proof on concealed data (docs/challenge.md): single axes and two-mass
// drives in closed loop, in motions that never repeat, for the diagnoses by prediction error and by
// force balance.
//
//   graybox challenge make --set any_motion --quick --seed commit -o cases --truth truth
//
// From here: composition and draws (any_motion_draw.hpp), machines (any_motion_system.hpp), laws
// (any_motion_laws.hpp), simulation (drive_simulation.hpp, stiff_integrator.hpp), detectability
// (innovation_detectability.hpp), files (any_motion_case.hpp).
#pragma once

#include "bench/challenge/challenge_set.hpp"

namespace graybox::bench {

[[nodiscard]] const ChallengeSet& any_motion_set();

}  // namespace graybox::bench
