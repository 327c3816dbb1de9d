// Plain friction first: viscous and Coulomb friction at every free mass, all at once.
//
// One by one they hide each other: friction at a motor and at its load, taken alone, ask for a
// friction that grows, a lag or a drag to make up for what is still missing. Together they are one
// fit from a poorer model's optimum, and those that nobody misses go again.
#pragma once

#include <vector>

#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

// The extensions of the group: of each free mass the laws that the model does not have there.
[[nodiscard]] std::vector<LawExtension> friction_group(const std::vector<LawExtension>& extensions,
                                                       const LumpedModel& model);

// `poorer` with all of the group, started at none of it. Not usable where it can't be simulated.
[[nodiscard]] PredictionFit with_group(const PredictionFitter& fitter, const PredictionFit& poorer,
                                       const Eigen::VectorXd& weights,
                                       const std::vector<LawExtension>& group, int iterations);

}  // namespace graybox
