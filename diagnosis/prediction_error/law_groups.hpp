// Laws that are tried all at once, since one by one they hide each other. They are one fit from a
// poorer model's optimum, and those that nobody misses go again.
//
// Plain friction: viscous and Coulomb friction at every free mass. Friction at a motor and at its
// load, taken alone, ask for a friction that grows, a lag or a drag to make up for what is missing.
//
// Coulomb friction and drag at one mass: beside a damping that is stated, each alone bends the
// wrong way.
//
// Coulomb friction at one mass and a drive whose gain bends: each alone bends the wrong way, too.
//
// A weight and Coulomb friction at one mass: what falls once and comes to rest shows neither alone.
//
// A spring and where it rests: stiffness and a constant force at a free mass. About the zero of the
// sensor a spring pulls the wrong way wherever the mass swings on one side of that zero.
#pragma once

#include <vector>

#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

// The extensions of the group: of each free mass the laws that the model does not have there.
[[nodiscard]] std::vector<LawExtension> friction_group(const std::vector<LawExtension>& extensions,
                                                       const LumpedModel& model);

// Where one mass moves freely that has neither, Coulomb friction and drag.
[[nodiscard]] std::vector<std::vector<LawExtension>> dragged_friction(
    const std::vector<LawExtension>& extensions, const LumpedModel& model);

// By drive of a free mass that has neither, Coulomb friction and a curved gain.
[[nodiscard]] std::vector<std::vector<LawExtension>> bent_drives(
    const std::vector<LawExtension>& extensions, const LumpedModel& model);

// By free mass that has neither, a weight and Coulomb friction.
[[nodiscard]] std::vector<std::vector<LawExtension>> braked_weights(
    const std::vector<LawExtension>& extensions, const LumpedModel& model);

// By free mass that has neither, a spring and a constant force.
[[nodiscard]] std::vector<std::vector<LawExtension>> resting_springs(
    const std::vector<LawExtension>& extensions, const LumpedModel& model);

// Whether the model swings about the rest -f/k of its last two laws, k a stiffness and f a constant
// force: it passes there three times at least. What goes there and stays tells no spring. `motion`:
// samples x (positions, velocities).
[[nodiscard]] bool swings_about_rest(const ExtendedLumpedModel& model,
                                     const Eigen::MatrixXd& motion);

// `poorer` with all of the group, started at none of it. Not usable where it can't be simulated.
[[nodiscard]] PredictionFit with_group(const PredictionFitter& fitter, const PredictionFit& poorer,
                                       const Eigen::VectorXd& weights,
                                       const std::vector<LawExtension>& group, int iterations);

}  // namespace graybox
