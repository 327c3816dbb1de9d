// The kinds of models that model_prediction.hpp predicts.
#pragma once

#include "diagnosis/prediction/model_prediction.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

[[nodiscard]] ModelPrediction predict_outputs(const LumpedModel& model, const Campaign& campaign,
                                              int threads, FreeRunStart start);
[[nodiscard]] ModelPrediction predict_forces(RigidRobotModel robot, const Campaign& campaign);

}  // namespace graybox
