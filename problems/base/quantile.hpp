// Quantiles of a sample.
#pragma once

#include <vector>

namespace graybox {

// The value that `share` of the sorted sample (not empty) lies below, by linear interpolation
// between order statistics (Hyndman and Fan 1996, type 7).
[[nodiscard]] double quantile(const std::vector<double>& sorted, double share);

}  // namespace graybox
