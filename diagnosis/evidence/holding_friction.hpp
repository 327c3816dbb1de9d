// Does the friction that was found hold what the machine stood still under? A machine that stands
// under a drive has dry friction, or a drive that does nothing so small (standing_drive.hpp).
#pragma once

#include <optional>
#include <span>
#include <string>

#include "diagnosis/evidence/diagnosis.hpp"

namespace graybox {

// The force of a friction at this speed, while it slides.
[[nodiscard]] double sliding_force(const FittedLaw& law, const std::string& name, double speed);

// Sets CheckedRange::Standing::holds: what the laws found hold at a hundredth of the highest speed,
// and, of a drive that does nothing below a threshold, that threshold.
void add_holding_friction(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis);

// Fails where that is less than half of what was held for sure. None where no standstill told any,
// or nothing was asked.
[[nodiscard]] std::optional<VerdictReason> holding_reason(const CheckedRange& range);

}  // namespace graybox
