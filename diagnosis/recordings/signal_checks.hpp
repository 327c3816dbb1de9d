// Faults of a recorded signal that a plot would show: numbers that are none, a sensor at its limit,
// a wire that is not connected.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/signal_faults/finding.hpp"

namespace graybox {

// Adds findings on samples `offset` and on of `source` (for messages), in the recorded unit.
//   Errors: NaN or infinite; beyond 1e50, where sums of powers overflow.
//   Warnings: constant; at or beyond a stated `range`; or, without one, clipped_samples() > 0.
void check_signal(const std::string& source, const Eigen::Ref<const Eigen::VectorXd>& values,
                  const std::optional<std::pair<double, double>>& range, std::size_t offset,
                  std::vector<Finding>& findings);

// Samples that lie in flat tops at the largest or flat bottoms at the smallest value and look like
// a limit. That takes at least two runs of at least four equal samples at that value. It must be
// entered at least once by a step above a tenth of the rms step and above twice the smallest step.
// (A quantised signal that turns there enters by single steps.) The number is 0 for signals of at
// most 16 values: they switch.
[[nodiscard]] std::size_t clipped_samples(const Eigen::Ref<const Eigen::VectorXd>& values);
// Which samples those are.
[[nodiscard]] std::vector<Eigen::Index> clipped_places(
    const Eigen::Ref<const Eigen::VectorXd>& values);

// Samples that stand alone: further than 20 median absolute deviations from the median, and reached
// and left within one sample by steps of at least half that distance and ten times the step that 95
// % of all steps keep below. A real pulse takes more samples, and a signal full of pulses has many
// large steps. Empty for signals of at most 16 values. Sorts three copies: O(n).
[[nodiscard]] std::vector<Eigen::Index> wild_samples(
    const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace graybox
