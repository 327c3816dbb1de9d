// A second look at a drive whose damping came out below zero beside dry friction. That damping is
// held at zero.
//
// At about one speed damping and dry friction are one number, and the fit may split it into a
// damping below zero and a friction that is too large.
#pragma once

#include <optional>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// The force balance of the drive once more without its damping. None where no damping came out
// below zero in `first`, where it was stopped, or where it does not do about as well. It does with
// laws found, sizes that a machine can have, and an error of at most 1.5 times that of `first`.
[[nodiscard]] std::optional<DiagnosisAnswer> answer_without_negative_damping(
    const DiagnosisRequest& request, const Campaign& campaign, const RigidRobotModel& drive,
    const DiagnosisAnswer& first);

}  // namespace graybox
