// A second look at a robot without those inertias of rotors that its recordings do not show, or
// that a fit makes negative.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"

namespace graybox {

// Joints, from 0, whose unknown rotor inertia the recordings do not show, or that came out
// negative. Empty unless that alone keeps the answer from being sure, or from being one that a
// machine can have. `graybox model` adds such inertias to robots.
[[nodiscard]] std::vector<std::size_t> rotors_to_leave_out(const Diagnosis& diagnosis);

// The diagnosis once more without these rotors, where nothing else was in doubt in `first`. None
// where no rotor is to be left out, where it was stopped, or where its verdict is no better.
[[nodiscard]] std::optional<DiagnosisAnswer> answer_without_unseen_rotors(
    const DiagnosisRequest& request, const Campaign& campaign, const Diagnosis& first);

}  // namespace graybox
