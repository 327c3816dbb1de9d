// Where a model leaves more than noise: whitened residuals summed over channels, bands of
// frequency, positions and levels.
#pragma once

#include <vector>

#include "diagnosis/harmonic_balance/model_state.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Noise estimated from few lines and periods makes sums of squares scatter more: `effective` of a
// cell (noise_whitening.hpp). Cost: a steady state for each recording. Of the recordings of the
// fit; bands of equal width in the logarithm of frequency.
[[nodiscard]] std::vector<MismatchCell> mismatch_map(const PlantFamily& family,
                                                     const PeriodicData& data,
                                                     const ModelState& model, int threads);

}  // namespace graybox
