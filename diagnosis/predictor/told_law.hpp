// Whether a fit tells a law of its model at all: its size from none, its frequency, its wave.
#pragma once

#include <Eigen/Core>

#include "diagnosis/predictor/extended_lumped_model.hpp"
#include "diagnosis/predictor/prediction_data.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

// Whether a size of the law is free, and one of these is larger than so many of its standard
// errors. Sizes are the parameters that are forces, or set one; all where none is. `deviations`:
// of the free parameters.
struct ToldSize {
  bool is_free = false, is_told = false;
};
[[nodiscard]] ToldSize told_size(const PredictionFit& fit, const Eigen::VectorXd& deviations,
                                 const PlacedFinding& law, double errors);

// Whether a free parameter of the law is larger than so many of its standard errors.
[[nodiscard]] bool has_told_parameter(const PredictionFit& fit, const Eigen::VectorXd& deviations,
                                      const PlacedFinding& law, double errors);

// Something that swings at a frequency whose error is 0.3 of it or more.
[[nodiscard]] bool has_loose_frequency(const PredictionFit& fit, const Eigen::VectorXd& deviations,
                                       const PlacedFinding& law);

// Something that swings fewer than two times in the longest recording of the fit. What it takes
// may be any slow change.
[[nodiscard]] bool swings_too_slowly(const PredictionFit& fit, const PlacedFinding& law,
                                     const PredictionData& data);

// A signal that is as late as the search allows. Where no second sensor tells against what,
// something else is missing.
[[nodiscard]] bool is_late_at_bound(const PredictionFit& fit, const PlacedFinding& law);

// A drive whose gain, bent as found, turns its sign within what was asked of it. No drive does.
[[nodiscard]] bool turns_its_drive(const PredictionFit& fit, const PlacedFinding& law);

// A speed's sensor that is said to be off from zero, though it reads exactly zero two samples in a
// row or where two recordings begin; or by more than a tenth of all that it ever read.
[[nodiscard]] bool contradicts_its_zero(const PredictionFit& fit, const PlacedFinding& law,
                                        const PredictionData& data);

// Any of the four before, or sizes out of order, as of a Stribeck curve that holds less at
// standstill than sliding: a law as no machine has it.
[[nodiscard]] bool is_on_no_machine(const PredictionFit& fit, const PlacedFinding& law,
                                    const PredictionData& data);

// A wave longer than the way that was gone is none: it stands in for a constant or a spring.
// `motion`: samples x (positions, velocities).
[[nodiscard]] bool is_longer_than_the_way(const PredictionFit& fit, const PlacedFinding& law,
                                          const Eigen::MatrixXd& motion);

}  // namespace graybox
