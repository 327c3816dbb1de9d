// A start for the fit of periodic recordings where the model's own values are too far off: the maximum
// likelihood fit to the measured frequency responses (maximum_likelihood.hpp), whose closed-loop stage
// finds its way past resonances that are narrower than the error.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "graybox/diagnosis/periodic_mismatch/periodic_data.hpp"
#include "graybox/diagnosis/periodic_mismatch/plant_family.hpp"

namespace graybox {

// None where sub-experiments are missing, a parameter is not positive, or no fit is found.
[[nodiscard]] std::optional<Eigen::VectorXd> response_start(const PlantFamily& family,
                                                            const PeriodicData& data, int threads);

}  // namespace graybox
