// A second look at a drive by its balance of forces, beside a diagnosis by prediction error.
//
// It is asked where the prediction error came to no answer, unless what it found takes nearly all
// of the force. And it is asked where that found late sensors or things that swing, and nothing
// else. What moves slowly is foretold nearly as well whatever pushes it. The balance tells forces
// there.
#pragma once

#include <optional>
#include <string>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

struct BalanceLook {
  std::optional<DiagnosisAnswer> answer;  // none: that of the prediction error stands
  std::optional<double> error;  // what the balance leaves, % of the force; none: it gave no answer
  bool was_stopped = false;
};

// There is no answer where the balance finds nothing, or can't be set up: the drive stands still,
// say. Nor where positions were differentiated and no machine can be what came of it, unless the
// prediction error is farther from an answer still.
[[nodiscard]] BalanceLook look_at_balance(const RigidRobotModel& drive,
                                          const DiagnosisRequest& request, const Campaign& campaign,
                                          const DiagnosisAnswer& predicted);

// Whether a friction is as large as the largest force that ever acted: it would have held the
// machine. At one level of drive and one speed it takes all, and nothing is left for an inertia.
[[nodiscard]] bool is_all_friction(const DiagnosisAnswer& balanced);

// Both methods come to an answer, and nobody knows which is right: the verdict of the balance is
// then `ambiguous` at best.
void weigh_against_prediction(const DiagnosisAnswer& predicted, Diagnosis& balanced);

// Why the balance answers, and not the prediction error: the end of method_line().
[[nodiscard]] std::string reason_for_balance(const DiagnosisAnswer& predicted);

}  // namespace graybox
