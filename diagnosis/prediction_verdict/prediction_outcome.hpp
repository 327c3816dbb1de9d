// What a diagnosis by prediction error has at its end: from this its effects, its reasons and its
// verdict are told. All that it points to must outlive it.
#pragma once

#include "diagnosis/final_fit/final_fit.hpp"

namespace graybox {

struct PredictionOutcome {
  const LumpedModel* stated = nullptr;
  const PredictionData* data = nullptr;  // all samples
  const PredictionHypotheses* hypotheses = nullptr;
  const PredictionFindings* findings = nullptr;  // of the search
  const FinalFit* final = nullptr;
};

// Whether so few samples were recorded that a search over whole recordings takes seconds.
[[nodiscard]] inline bool is_short(const PredictionData& data) {
  constexpr Eigen::Index kLong = 4000;  // samples
  Eigen::Index samples = 0;
  for (const OutputErrorRecording& recording : data.recordings()) samples += recording.time.size();
  return samples < kLong;
}

}  // namespace graybox
