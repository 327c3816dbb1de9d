// Where a ripple may be: the periods at which the force that a model lacks comes back with the
// position.
//
// The latent force (latent_force.hpp) of a free coordinate is held against sines of its position.
// Only samples that move count. The best of a fine grid of orders are trials for a search.
#pragma once

#include <vector>

#include "diagnosis/predictor/latent_force.hpp"

namespace graybox {

struct RippleTrial {
  Eigen::Index coordinate = 0;
  double period = 0.0, phase = 0.0;  // of sin(2 pi z/period + phase)
  double share = 0.0;                // of the force's variance that it takes
};

// The best two of each coordinate, at least one period within its range apart. None where the range
// holds fewer than one and a half periods.
[[nodiscard]] std::vector<RippleTrial> ripple_trials(const LatentForce& force);

// Samples of a force that say something: settled, and moving faster than 1 % of the fastest motion.
[[nodiscard]] std::vector<Eigen::Index> moving_samples(const LatentForce& force);

}  // namespace graybox
