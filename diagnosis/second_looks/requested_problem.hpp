// The problem of a request: what the search for missing laws works on, with the threads and the
// places that were asked for.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// Of the model as its format asks, without the inertias of some rotors (joints, from 0). Null where
// it was stopped (stop.hpp) before there was a problem. Throws InputError as
// load_mismatch_problem() does.
[[nodiscard]] std::unique_ptr<MismatchProblem> requested_problem(
    const DiagnosisRequest& request, const Campaign& campaign,
    const std::vector<std::size_t>& without_rotors = {});

// Of a lumped model as the force balance of its one mass. Null and errors as above.
[[nodiscard]] std::unique_ptr<MismatchProblem> requested_drive_problem(
    const DiagnosisRequest& request, const Campaign& campaign, const RigidRobotModel& drive);

}  // namespace graybox
