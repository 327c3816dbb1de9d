// Starting values of two masses and their spring, by least squares over windows instead of
// derivatives: with a triangle w of two windows' width,
//
//   J [q(t+W) - 2 q(t) + q(t-W)] = sum over s of w(s) (force - friction)(t+s),
//
// and with a velocity v, J [v(t+W) - v(t-W)] = sum of force - friction over both windows. Columns
// for viscous and dry friction and a constant stand beside, so that the mass is not taken for them.
// The motor's equation and the sum of both masses' are solved together. The load's equation
// by itself has nothing on its right side: noise of the twist, or play, then shrinks load and
// spring together. A column for the side of the play stands beside the spring.
// SI units, or those of the force. Values are starts: the diagnosis fits them.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace graybox {

struct TwoMassStart {
  double motor = 0.0, load = 0.0;         // inertias
  double stiffness = 0.0, damping = 0.0;  // between them
};

// Two masses whose positions (or velocities) are both measured; the force acts on the first. Where
// a value is not positive, each equation by itself is tried. None where one is not positive then.
[[nodiscard]] std::optional<TwoMassStart> start_two_masses(const Eigen::VectorXd& force,
                                                           const Eigen::VectorXd& motor,
                                                           const Eigen::VectorXd& load,
                                                           bool are_velocities, double sample_time);

// Two masses with one sensor at the first: antiresonance and resonance by a grid, in the frequency
// domain, with the total inertia from each. None where no pair is better than one mass by a tenth.
[[nodiscard]] std::optional<TwoMassStart> start_one_encoder(const Eigen::VectorXd& force,
                                                            const Eigen::VectorXd& motor,
                                                            bool is_velocity, double sample_time);

// How much the acceleration of a mass, over a few samples, follows the force: the largest
// correlation over windows of 2 to 16 samples, with its sign.
[[nodiscard]] double follows_at_once(const Eigen::VectorXd& force, const Eigen::VectorXd& motion,
                                     bool is_velocity);

}  // namespace graybox
