// The force that recordings ask for at a law's place, sample by sample, beside what the law gives
// there.
//
// Recorded is what the model leaves. At each line the force is the law's and the force that takes
// the residual, by least squares over the channels: unbiased, with the noise 2 / |a|^2 where the
// whitened answer to the force is a. All lines count, also those where the law leaves no more than
// noise: a picture without its noise would prove nothing. Lines are taken from the least noise on,
// until their noise together reaches kNoiseShare of the law's rms. Where these hold less than
// kSeenShare of the law's power, the recordings say too little, and nothing is drawn but the law.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/harmonic_balance/model_state.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// One of each law of the model from the first asked for on, in their order, `hypothesis` left open;
// empty for laws that are linear, part of the plant or of a channel. Of the recording with the
// largest force, along the model's motion. Cost: a steady state for each recording, on one thread.
[[nodiscard]] std::vector<ForcePicture> law_pictures(const PlantFamily& family,
                                                     const PeriodicData& data,
                                                     const ModelState& model, std::size_t first);

}  // namespace graybox
