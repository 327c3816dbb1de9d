// Two laws that no machine has beside each other, by their forces along the recorded motion.
#pragma once

#include "diagnosis/plausibility/fitted_physics.hpp"

namespace graybox {

// The forces cancel: correlation below -0.95, and a sum of less than a fifth of each.
[[nodiscard]] bool cancel(const LawTrace& first, const LawTrace& second);

// Two springs at one place that together pull back in the middle third of the motion, and push
// away, more than half as steeply, in an outer sixth.
[[nodiscard]] bool turns_round(const LawTrace& first, const LawTrace& second);

}  // namespace graybox
