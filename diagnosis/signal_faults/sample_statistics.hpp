// What the detectors of data faults share: order statistics of samples and of their steps.
#pragma once

#include <Eigen/Core>

namespace graybox {

// The value that a share (0 to 1) of all values stays below. At least one value. Cost: O(n).
[[nodiscard]] double quantile(Eigen::VectorXd values, double share);

// values(k + 1) - values(k). At least two values.
[[nodiscard]] Eigen::VectorXd steps_of(const Eigen::Ref<const Eigen::VectorXd>& values);

// The median of the five values around each; of the nearest five at the ends. At least five values.
[[nodiscard]] Eigen::VectorXd running_median(const Eigen::Ref<const Eigen::VectorXd>& values);

// Whether a signal has few levels, as switches and steps of a reference have: at most 16 values.
[[nodiscard]] bool has_few_levels(const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace graybox
