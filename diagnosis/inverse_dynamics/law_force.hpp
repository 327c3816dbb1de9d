// The force of a law along a motion that is known: samples of deflection and rate, at even or
// uneven times.
//
// Laws with states start at rest at the first sample. Over one step the state follows its equation
// linearised at the step's beginning, x+ = x + h phi_1(h J) g(z, z', x) with z and z' in the middle
// of the step (exponential Euler: Pope 1963). A bristle under constant velocity is followed
// exactly, whatever its stiffness. J is a difference quotient along the step: exact where g is
// linear in x.
#pragma once

#include <Eigen/Core>

#include "problems/laws/law.hpp"

namespace graybox {

struct RecordedPlaceMotion {
  Eigen::VectorXd time, deflection, rate, acceleration;
};

[[nodiscard]] Eigen::VectorXd law_force(const Law& law, const RecordedPlaceMotion& motion);

// Whether the force depends on where zero is, beside how the place moves: tried at a few motions.
[[nodiscard]] bool depends_on_position(const Law& law);

}  // namespace graybox
