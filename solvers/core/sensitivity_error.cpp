#include "solvers/core/sensitivity_error.hpp"

#include <cmath>
#include <limits>

#include "problems/base/packed_matrix.hpp"

namespace graybox {

double sensitivity_error(std::span<const double> information, std::span<const double> trace_dual,
                         std::size_t dimension, std::size_t support) {
  constexpr double kUnit = std::numeric_limits<double>::epsilon() / 2;
  constexpr double kConfidence = 4.0;
  double inflation = 0.0;
  for (std::size_t j = 0; j < dimension; ++j) {
    const std::size_t k = packed_index(j, j);
    inflation += information[k] * trace_dual[k];
  }
  // Chains: the sum M, its factor and inverse, W, and the trace over the packed entries.
  const auto chain = static_cast<double>(support + 4 * dimension + information.size());
  return kConfidence * std::sqrt(chain) * kUnit * inflation;
}

}  // namespace graybox
