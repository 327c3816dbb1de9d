// The force that recordings ask for at a law's place, sample by sample, beside what the law gives there.
#pragma once

#include <cstddef>
#include <vector>

#include "graybox/diagnosis/hypotheses/mismatch_problem.hpp"
#include "graybox/diagnosis/periodic_mismatch/periodic_data.hpp"
#include "graybox/diagnosis/periodic_mismatch/plant_family.hpp"
#include "graybox/diagnosis/periodic_mismatch/steady_state.hpp"

namespace graybox {

// One of each law of the model from the first asked for on, in their order, `hypothesis` left open; empty for laws that
// are no function of motion at an element. Of the recording with the largest force.
[[nodiscard]] std::vector<ForcePicture> law_pictures(const PlantFamily& family,
                                                     const PeriodicData& data,
                                                     const ModelState& model, std::size_t first);

}  // namespace graybox
