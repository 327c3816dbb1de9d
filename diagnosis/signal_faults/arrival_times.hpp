// Times that tell when samples arrived, not when they were taken: the samples are even, the times
// jitter. A position differentiated twice by such times is mostly jitter.
//
// Rule: each sample of a position is left out and interpolated from its four neighbours (Lagrange),
// once by the recorded times and once as if samples were even. Of the half of the samples that move
// most, the median error as if even is below kSmoother of that by the times. Only where no
// step is so long that a sample may have been lost; what rounding or noise leaves is the same by
// both.
// Rates: docs/how_to/faulty_data.md. Cost: O(n).
#pragma once

#include <Eigen/Core>
#include <optional>

namespace graybox {

inline constexpr double kSmoother = 0.5;

struct ArrivalTimes {
  double step;      // s, mean
  double strength;  // kSmoother times the error by the times over that as if even, above 1
};

// Rising times. Below 100 samples there is no answer.
[[nodiscard]] std::optional<ArrivalTimes> find_arrival_times(
    const Eigen::Ref<const Eigen::VectorXd>& time,
    const Eigen::Ref<const Eigen::VectorXd>& position);

}  // namespace graybox
