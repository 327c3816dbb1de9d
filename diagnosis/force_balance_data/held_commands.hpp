// When a recorded force acts. A command u_k that is held until the next sample moves a mass by
//
//     (q_(k+1) - 2 q_k + q_(k-1)) / T^2 = (u_(k-1) + u_k) / (2 m)
//
// exactly, so what acts about sample k is the mean of two commands: half a sample later than the
// recorded force. A force that was measured acts when it was measured.
//
// The recordings tell which. The plain balance
//
//     y = m q'' + d q' + c sign(q') + o
//
// is fitted to y = (u_(k-1) + u_k)/2 and to y = (u_(k-1) + 4 u_k + u_(k+1))/6. Both means have the
// same noise, half of u's variance, so the sum of squares that is left tells when the force acts,
// not which mean is smoother.
#pragma once

#include <vector>

#include "diagnosis/inverse_dynamics/motion_record.hpp"

namespace graybox {

// Whether the first leaves less, by four standard errors over twenty blocks. The recordings are of
// one joint; those of the fit decide. Cost: O(N).
[[nodiscard]] bool are_held_commands(const std::vector<MotionRecord>& records);

// Each force becomes the mean of itself and the one before it.
void take_means_of_held(std::vector<MotionRecord>& records);

}  // namespace graybox
