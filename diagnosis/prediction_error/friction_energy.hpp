// Whether the frictions of a model take energy, along its own motion.
//
// At each place all laws without memory count together, each without what its deflection alone
// gives back: P = sum (f(z, z') - f(z, 0)) z'. The share of fed-in energy is sum max(-P, 0) / sum
// |P|; a machine's friction has none. Where a law has memory it may give back what it took: there P
// is of the whole forces, and the share is max(-sum P, 0) / sum |P|.
#pragma once

#include <Eigen/Core>

#include "diagnosis/predictor/extended_lumped_model.hpp"

namespace graybox {

// The largest share of all places, 0 to 1. `motion`: q and q' of all coordinates, a row a sample.
[[nodiscard]] double fed_in_share(const LumpedModel& model, const Eigen::MatrixXd& motion,
                                  double sample_time);

}  // namespace graybox
