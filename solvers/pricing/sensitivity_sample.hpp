// SensitivitySample: where to cut a list of the largest sensitivities, without sorting them all.
// The threshold is a quantile of a strided sample, so the list comes out about as long as wanted.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace graybox {

class SensitivitySample {
 public:
  explicit SensitivitySample(std::span<const double> sensitivities);  // not empty

  // A value that about `wanted` of the sensitivities exceed. O(sample).
  [[nodiscard]] double exceeded_by(std::size_t wanted);

 private:
  std::size_t count_;  // of all sensitivities
  std::vector<double> sample_;
};

}  // namespace graybox
