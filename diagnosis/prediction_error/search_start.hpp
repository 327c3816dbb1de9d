// Where a search by prediction errors begins: the model as it is stated, but for what is commonly
// stated wrongly and would hide all else.
//
// Zeros of encoders. A spring between two masses that are both measured holds still at the
// difference of its encoders' zeros. Where that constant is ten times what the spring moves by, the
// zeros are not alike: an offset of a sensor, the mean, is part of the start.
//
// One factor. Stated masses, springs and dampers may all be off by one factor, in the wrong unit or
// with a guessed gain: the one in 0.001 ... 1000 that predicts best, ten samples ahead.
#pragma once

#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/predictor/extended_lumped_model.hpp"
#include "diagnosis/predictor/prediction_data.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

// How far masses and springs may move from there.
inline constexpr double kSearchFactor = 10.0;
inline constexpr Eigen::Index kFirstHorizon = 10;  // samples

// Intensities of the force noise that are tried: decades about that of the forces.
[[nodiscard]] std::vector<double> force_noise_intensities(const PredictionData& data);

// The best of fits so far ahead (data.windows), one for each of these intensities; `iterations` 0:
// the model as it is. Unusable where its motion leaves all bounds under each.
struct IntensityFit {
  PredictionFit fit;
  double intensity = 0.0;
};
[[nodiscard]] IntensityFit best_intensity(const ExtendedLumpedModel& model,
                                          const PredictionData& data, const PredictionTask& task,
                                          int iterations, int threads);

// The model with the encoders' zeros that it needs, as laws found.
[[nodiscard]] ExtendedLumpedModel with_zeros(const LumpedModel& model, const PredictionData& data,
                                             const PredictionHypotheses& hypotheses);

// The model times the factor that predicts best; as it is where all its motion is imposed.
[[nodiscard]] ExtendedLumpedModel scaled_to_predict(const ExtendedLumpedModel& model,
                                                    const PredictionData& data, int threads);

}  // namespace graybox
