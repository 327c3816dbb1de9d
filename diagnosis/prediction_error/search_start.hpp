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

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/predictor/extended_lumped_model.hpp"
#include "diagnosis/predictor/prediction_data.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

// How far masses and springs may move from there.
inline constexpr double kSearchFactor = 10.0;

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

// The intensity with which a filter finds the state that a free run starts from: the one by which
// the model as it is predicts first_horizon() samples best. The better the model, the less its
// filter follows the sensors' noise.
[[nodiscard]] double start_intensity(const ExtendedLumpedModel& model, const PredictionData& data,
                                     int threads);

// A few iterations, first_horizon() samples ahead.
[[nodiscard]] PredictionFit short_fit(const ExtendedLumpedModel& start, const PredictionData& data,
                                      int threads);
// Noise that is not stated is no larger than what leaves the model's errors, one sample and
// first_horizon() ahead.
void limit_noise(PredictionData& data, const LumpedModel& model, int threads);
// How a fault of a channel must show in short fits: less than half of the cost is left, and the
// blocks are better predicted by z > 3.
[[nodiscard]] bool is_clearly_better(const PredictionFit& other, const PredictionFit& stated);

// A law of one parameter at the sensor of an output, for extended(); none where the model has it,
// or it is not tried.
[[nodiscard]] std::optional<LawExtension> missing_at_sensor(const LumpedModel& model,
                                                            std::size_t output,
                                                            const std::string& law,
                                                            const PredictionHypotheses& hypotheses);

// The model with the encoders' zeros that it needs, as laws found.
[[nodiscard]] ExtendedLumpedModel with_zeros(const LumpedModel& model, const PredictionData& data,
                                             const PredictionHypotheses& hypotheses);

// The only mass of a model and its damper as the recordings of the fit suggest them: an answer
// should not depend on a guess. About d = f / v and m = d T masses and dampings are tried over
// three decades each way. Here f and v are rms of force and velocity, and T is the first time that
// tells motion from noise. Short fits go on from the three that predict best: that from which the
// best fit came is the start. What is stated stays where a short fit from there does as well. It
// stays, too, where the best leaves more than half of what a heaviest mass or strongest damper
// leaves, which no force moves: so simple a model then tells little, as beside a spring that it
// lacks. What is fixed stays. Other models stay, and one whose motion is not measured, or may lack
// its sign. Cost: 169 passes and four short fits. `data`: every sample; those that the fits take
// are thinned to `limit`.
[[nodiscard]] LumpedModel started_by_data(const LumpedModel& model, const PredictionData& data,
                                          const SampleLimit& limit, int threads);

// Where the fit begins: a guess may be off by orders of magnitude in one kind of parameter and not
// in another, and least squares then end in another valley. Masses (with springs, so that modes
// stay) and dampings times any factors of 0.001 to 1000; the three that predict best are fitted,
// and the best takes the place of the model if that halves the cost of the model's own fit. So far
// ahead that the motion stands out of the sensors' noise. Cost: 169 passes and four short fits.
[[nodiscard]] ExtendedLumpedModel started_to_predict(const ExtendedLumpedModel& model,
                                                     const PredictionData& data, int threads);

// The model times the factor that predicts best; as it is where all its motion is imposed.
[[nodiscard]] ExtendedLumpedModel scaled_to_predict(const ExtendedLumpedModel& model,
                                                    const PredictionData& data, int threads);

}  // namespace graybox
