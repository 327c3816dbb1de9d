// The laws that the set `any_motion` hides: those of bench/challenge/hidden_laws.hpp that make
// sense in a motion that never repeats, with sizes for it, and some of its own.
//
//   dry friction     its sign is rounded over 1/5000 of the rms rate: at standstill it holds but
//                    for a creep that no encoder here sees
//   gravity          s sin z + c cos z, the weight of an arm on a turning axis
//   ripple           3 to 12 waves a turn, with a second harmonic
//   fading_friction  outside the catalogue: dry friction whose level falls to 0.3 of itself as the
//                    machine warms up, level (0.3 + 0.7 exp(-t/T)); its clock is a state
#pragma once

#include <string_view>
#include <vector>

#include "bench/challenge/hidden_laws.hpp"

namespace graybox::bench {

// Kinds of places, as bits beside those of PlaceKind.
inline constexpr unsigned kHeldAxisPlace = 64;       // an axis whose position is controlled
inline constexpr unsigned kUndampedAxisPlace = 128;  // an axis whose damping the model leaves out

[[nodiscard]] const std::vector<HiddenLaw>& any_motion_laws();

// Null if there is none.
[[nodiscard]] const HiddenLaw* find_any_motion_law(std::string_view name, bool at_signal);

}  // namespace graybox::bench
