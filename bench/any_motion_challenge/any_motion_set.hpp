// The set `any_motion` of the proof on concealed data (docs/explanation/challenge.md). It has
// single axes and two-mass drives in closed loop, in motions that never repeat. It is for the
// diagnoses by prediction error and by force balance.
//
//   graybox challenge make --set any_motion --quick --seed commit -o cases --truth truth
//
// From here:
//
//   any_motion_draw.hpp                         composition and draws
//   any_motion_system.hpp                       machines
//   any_motion_laws.hpp                         laws
//   drive_simulation.hpp, stiff_integrator.hpp  simulation
//   innovation_detectability.hpp                detectability
//   any_motion_case.hpp                         files
#pragma once

#include "bench/challenge/challenge_set.hpp"

namespace graybox::bench {

[[nodiscard]] const ChallengeSet& any_motion_set();

}  // namespace graybox::bench
