// What a report draws of laws found by prediction: the force that was there, against the law.
//
// The force at a sample is the law's own, along the filter's motion, plus the force that remains
// (latent_force.hpp). Only samples that move are drawn.
#pragma once

#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/predictor/latent_force.hpp"

namespace graybox {

// One for each law of `model`, in their order. It is empty for a law of a signal, for one with
// memory, and at another place than that of the force that remains.
[[nodiscard]] std::vector<ForcePicture> latent_pictures(const ExtendedLumpedModel& model,
                                                        const LatentForce& force);

}  // namespace graybox
