// A prediction for other programs, graybox-prediction/1: a row for each channel of each recording
// and horizon. Numbers that are not known are null.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "diagnosis/prediction/model_prediction.hpp"

namespace graybox {

// `model` and `campaign` as the user named them.
[[nodiscard]] nlohmann::ordered_json prediction_json(const ModelPrediction& prediction,
                                                     const std::string& model,
                                                     const std::string& campaign);

}  // namespace graybox
