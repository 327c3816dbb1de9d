#include "solvers/pricing/sensitivity_sample.hpp"

#include <algorithm>
#include <cstddef>
#include <functional>

namespace graybox {

SensitivitySample::SensitivitySample(std::span<const double> sensitivities)
    : count_(sensitivities.size()), sample_(512) {
  for (std::size_t k = 0; k < sample_.size(); ++k) {
    sample_[k] = sensitivities[count_ * k / sample_.size()];
  }
}

double SensitivitySample::exceeded_by(std::size_t wanted) {
  const std::size_t rank =
      std::clamp(sample_.size() * wanted / count_, std::size_t{1}, sample_.size() - 1);
  const auto cut = sample_.begin() + static_cast<std::ptrdiff_t>(rank);
  std::ranges::nth_element(sample_, cut, std::greater<>());
  return *cut;
}

}  // namespace graybox
