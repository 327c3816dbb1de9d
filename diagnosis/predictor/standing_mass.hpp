// What the force on the only mass of a model gave while that mass stood still (standing_drive.hpp).
#pragma once

#include "diagnosis/predictor/prediction_data.hpp"
#include "diagnosis/signals/standing_drive.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {

// By the recordings of the fit, and where the mass's position or velocity is measured. Not seen
// where something else may hold the mass: more masses, an imposed motion, or any part of the model
// but dampers.
[[nodiscard]] StandingDrive standing_drive_of_mass(const LumpedModel& model,
                                                   const PredictionData& data);

}  // namespace graybox
