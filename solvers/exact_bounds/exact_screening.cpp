#include "solvers/exact_bounds/exact_screening.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <unordered_set>
#include <utility>

#include "solvers/column_generation/screening.hpp"

namespace graybox {

CountLimits screen_counts(const Relaxation& relaxation, std::int64_t experiments,
                          double incumbent_log_det) {
  const auto d = static_cast<double>(relaxation.dimension);
  const auto m = static_cast<double>(experiments);
  const double largest =
      *std::ranges::max_element(relaxation.sensitivities) * (1.0 + kScreeningMargin);
  // Loss of the incumbent against M(lambda), per experiment; raised by what log det is not known
  // to.
  const double loss =
      relaxation.certificate.log_det + d * std::log(m) - incumbent_log_det + kScreeningMargin;
  const double budget = m * (largest - d * std::exp(-loss / d));
  CountLimits limits;
  for (std::size_t i = 0; i < relaxation.sensitivities.size(); ++i) {
    const double cost = largest - relaxation.sensitivities[i] * (1.0 + kScreeningMargin);
    if (cost > budget) continue;
    limits.candidates.push_back(i);
    limits.upper.push_back(cost * m > budget ? static_cast<std::int32_t>(budget / cost)
                                             : static_cast<std::int32_t>(experiments));
  }
  return limits;
}

void drop_copies(const InformationSet& set, CountLimits& limits) {
  std::unordered_set<std::string_view> seen;
  CountLimits kept;
  for (std::size_t k = 0; k < limits.candidates.size(); ++k) {
    const auto packed = set.information(limits.candidates[k]);
    if (!seen.emplace(reinterpret_cast<const char*>(packed.data()), packed.size_bytes()).second) {
      continue;
    }
    kept.candidates.push_back(limits.candidates[k]);
    kept.upper.push_back(limits.upper[k]);
  }
  limits = std::move(kept);
}

}  // namespace graybox
