// Sensors that read no sign: a tachometer that counts pulses, a rectified signal. They are told by
// prediction, before any law: no law of a machine is found in a speed whose sign is wrong half the
// time.
//
// Each output that never falls below zero and comes down to it is asked: the model at its best
// start (search_start.hpp) is fitted ten samples ahead, once as it is and once with the law
// `rectifier` at the sensor. The law begins the search where it leaves less than nine tenths of the
// cost and predicts the blocks better by z > 3. Recordings kept out are asked about it as about any
// other.
//
// Cost: two short fits for such an output.
#pragma once

#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/predictor/extended_lumped_model.hpp"
#include "diagnosis/predictor/prediction_data.hpp"

namespace graybox {

// `start` with rectifiers where the outputs have them, scaled to predict. Throws Stopped on
// request.
// Whether an output comes down to zero and never passes it: it may be read without its sign.
[[nodiscard]] bool never_negative(Eigen::Index output, const PredictionData& data);

[[nodiscard]] ExtendedLumpedModel with_unsigned_outputs(const ExtendedLumpedModel& start,
                                                        const PredictionData& data,
                                                        const PredictionHypotheses& hypotheses,
                                                        int threads);

}  // namespace graybox
