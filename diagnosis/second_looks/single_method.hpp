// The answer of one method, with the second looks that stay within it: rotors that are not seen,
// and a damping below zero beside dry friction.
#pragma once

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// A lumped model in any motion. Throws InputError as diagnose_by_prediction() does.
[[nodiscard]] DiagnosisAnswer answer_by_prediction(const DiagnosisRequest& request,
                                                   const Campaign& campaign);

// By the problem that the model's format asks for: periodic motion, or a robot's balance of forces.
// Throws InputError as load_mismatch_problem() does, and for laws to leave out that it does not
// have.
[[nodiscard]] DiagnosisAnswer answer_by_problem(const DiagnosisRequest& request,
                                                const Campaign& campaign);

// A lumped model as the force balance of its one mass. Throws InputError where that can't be set
// up: the drive stands still, say. Laws to leave out that it does not have are passed over, for the
// other method of a drive may have them.
[[nodiscard]] DiagnosisAnswer answer_by_drive(const DiagnosisRequest& request,
                                              const Campaign& campaign,
                                              const RigidRobotModel& drive);

}  // namespace graybox
