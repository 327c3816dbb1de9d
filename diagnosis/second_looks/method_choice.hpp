// What a diagnosis goes by: the method that was asked for, or the one that the model's format and
// the recordings ask for.
//
// A flexible robot is diagnosed by its periodic motion, a rigid one by its balance of forces. A
// lumped model leaves a choice. It is diagnosed line by line where its motion is periodic, its
// inputs are held and no acceleration is measured; by prediction error otherwise.
#pragma once

#include <optional>
#include <string>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

struct MethodChoice {
  std::string name;  // periodic, force_balance, prediction_error
  std::string reason;
  bool is_lumped = false;                // the model's format, which leaves a choice
  std::optional<RigidRobotModel> drive;  // a lumped model that is measured as a whole

  // Whether a lumped model is diagnosed in any motion.
  [[nodiscard]] bool takes_any_motion() const { return is_lumped && name != "periodic"; }
};

// Throws InputError where the method that was asked for can't be had with this model and these
// recordings, and for places or laws that the method knows nothing of.
[[nodiscard]] MethodChoice choose_method(const DiagnosisRequest& request, const Campaign& campaign);

// The choice and its reason as a sentence; empty where the model's format leaves none.
[[nodiscard]] std::string method_line(const MethodChoice& method);

}  // namespace graybox
