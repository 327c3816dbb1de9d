#include "diagnosis/prediction/prediction_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

namespace graybox {

using Json = nlohmann::ordered_json;

Json prediction_json(const ModelPrediction& prediction, const std::string& model,
                     const std::string& campaign) {
  Json rows = Json::array();
  for (const RecordingPrediction& recording : prediction.recordings) {
    for (const PredictedChannel& channel : recording.channels) {
      Json row{{"recording", recording.recording}, {"role", name_of(recording.role)},
               {"channel", channel.name},          {"unit", channel.unit},
               {"seconds_ahead", nullptr},         {"error", nullptr},
               {"deviation", channel.signal},      {"nrmse", nullptr}};
      if (recording.ahead > 0.0) row["seconds_ahead"] = recording.ahead;
      if (std::isfinite(channel.error)) {
        row["error"] = channel.error;
        if (channel.signal > 0.0) row["nrmse"] = channel.nrmse();
      }
      rows.push_back(std::move(row));
    }
  }
  return {{"format", "graybox-prediction/1"},
          {"model", model},
          {"campaign", campaign},
          {"predicted", prediction.of},
          {"initial_state", prediction.start == FreeRunStart::kMeasured ? "measured" : "free"},
          {"rows", rows},
          {"notes", prediction.notes}};
}

}  // namespace graybox
