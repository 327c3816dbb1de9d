// Where a motion that nothing is said to drive is driven: friction only slows down, and a weight or
// a spring gives back no more than it took.
//
// - A speed that grows and stays: from rest at the first sample, or threefold from the first tenth
//   of the log to the last one, whose mean is at least half of the largest speed. Where the motion
//   goes the other way at half of that speed, a weight or a spring turns it round.
// - A place that is left from rest, by a hand say, and comes back to rest there: whoever was at
//   rest where a free motion ends has no energy to leave with.
//
// A pendulum that is held aside and let go is neither: it ends elsewhere than it began. Nor is one
// that was struck before the first sample, which leaves its middle at once.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace graybox {

struct UndrivenGain {
  bool is_left_place = false;        // else a speed that stays
  Eigen::Index first = 0, last = 0;  // samples between which something drives
  double before = 0.0, after = 0.0;  // speeds; or places against that of the rest
};

// `times` rise, s. None where nothing contradicts, and for values that are no numbers.
[[nodiscard]] std::optional<UndrivenGain> find_undriven_gain(const Eigen::VectorXd& times,
                                                             const Eigen::VectorXd& motion,
                                                             bool is_velocity);

}  // namespace graybox
