// Measured frequency responses beside those of the model as it is, for the search for faults of
// wiring, sign and unit (channel_faults.hpp).
#pragma once

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/hypotheses/channel_faults.hpp"

namespace graybox {

// No lines where sub-experiments are missing, so that no response could be estimated.
[[nodiscard]] ComparedResponses compared_responses(const PlantFamily& family,
                                                   const PeriodicData& data,
                                                   const Eigen::VectorXd& parameters);

}  // namespace graybox
