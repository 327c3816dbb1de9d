// The force that recordings ask for at a law's place, sample by sample, beside what the law gives there.
#pragma once

#include <cstddef>
#include <vector>

#include "graybox/diagnosis/hypotheses/mismatch_problem.hpp"
#include "graybox/diagnosis/periodic_mismatch/model_state.hpp"
#include "graybox/diagnosis/periodic_mismatch/periodic_data.hpp"
#include "graybox/diagnosis/periodic_mismatch/plant_family.hpp"

namespace graybox {

// One of each law of the model from the first asked for on, in their order, `hypothesis` left open; empty for laws that
// are linear, part of the plant or of a channel. Of the recording with the largest force.
// Cost: a steady state for each recording, on one thread.
[[nodiscard]] std::vector<ForcePicture> law_pictures(const PlantFamily& family,
                                                     const PeriodicData& data,
                                                     const ModelState& model, std::size_t first);

}  // namespace graybox
