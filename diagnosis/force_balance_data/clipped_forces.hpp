// Forces that were recorded at their limit. Where a sensor or an amplifier clips, the force that
// acted is not the one recorded. What lies beyond is taken from it, most where the force is largest
// and with its sign: friction that is none. So such samples of a joint are left out of the balance,
// like those at which it stands still.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnosis/inverse_dynamics/motion_record.hpp"

namespace graybox {

// Marks in Motion::stands where the force of a joint lies in flat tops (clipped_samples() in
// signal_checks.hpp), over all pieces of a recording: one limit; and three samples beside, where
// noise alone may have kept it below the limit. Number of samples, by joint. A low-pass rounds flat
// tops, and none are found behind one.
[[nodiscard]] std::vector<Eigen::Index> mark_clipped_forces(std::vector<Motion>& pieces);

}  // namespace graybox
