// What a report draws of laws found by prediction: the force that was there, against the law. At a
// sample, that is the law's own force along the filter's motion plus the force that remains
// (latent_force.hpp), over samples that move.
#pragma once

#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/predictor/latent_force.hpp"

namespace graybox {

// One for each law of `model`, in their order; empty for laws of signals, for those with memory,
// and for those at another place than the force that remains.
[[nodiscard]] std::vector<ForcePicture> latent_pictures(const ExtendedLumpedModel& model,
                                                        const LatentForce& force);

}  // namespace graybox
