// Which cases a challenge in any motion has, and the draw of each.
//
// Of 240 cases (24 with `--quick`) 60 are axes with an encoder and 40 with a tachometer. 60 are
// drives with both encoders, 50 with that of the motor and 30 with a tachometer. In each family the
// proportions are the same: of all 40 have nothing missing, 120 one effect, 40 two, and 40 one that
// the catalogue lacks. Laws and places come in turn from a list that is shuffled for each family.
// Two effects are a pair of machines: viscous and dry friction at one place, dry friction at both
// masses, dry friction and a late channel, and others (kPairs in the source).
//
// Size as in the periodic set (case_draw.hpp): the smallest detectable size
// (innovation_detectability.hpp) times 20^U. Where a place hides a law at any size, or the machine
// does not move with it in all recordings, or in a limit cycle, the case takes another law and
// place.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "bench/any_motion_challenge/any_motion_system.hpp"
#include "bench/challenge/case_draw.hpp"

namespace graybox::bench {

// `family`: the only one, where given.
[[nodiscard]] std::vector<CaseOutline> compose_any_motion(std::size_t cases, std::uint64_t seed,
                                                          std::optional<Family> family = {});

// Every law that may be put at each place of a system.
[[nodiscard]] std::vector<LawAtPlace> possible_any_motion_effects(const AnyMotionSystem& system,
                                                                  bool in_catalogue);

// Empty name where `keep_going` has said no. Throws std::runtime_error where no effect can be
// drawn.
[[nodiscard]] CaseTruth draw_any_motion_case(const CaseOutline& outline,
                                             const std::function<bool()>& keep_going = {});

}  // namespace graybox::bench
