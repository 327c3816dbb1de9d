// Two laws that no machine has beside each other, by their forces along the recorded motion.
#pragma once

#include <span>

#include "diagnosis/plausibility/fitted_physics.hpp"

namespace graybox {

// Whether a constant force acts beside a spring at its place. It says where that rests, and may be
// as large as the sensor's zero is far away.
[[nodiscard]] bool sets_rest(const LawTrace& force, std::span<const LawTrace> laws);

// The forces cancel: correlation below -0.95, and a sum of less than a fifth of each. A spring and
// the constant force that sets its rest don't.
[[nodiscard]] bool cancel(const LawTrace& first, const LawTrace& second);

// Two springs at one place that together pull back in the middle third of the motion, and push
// away, more than half as steeply, in an outer sixth.
[[nodiscard]] bool turns_round(const LawTrace& first, const LawTrace& second);

}  // namespace graybox
