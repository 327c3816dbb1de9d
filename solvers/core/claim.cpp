#include "solvers/core/claim.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "problems/base/packed_matrix.hpp"

namespace graybox {

double gap_rounding(std::span<const double> information, std::span<const double> inverse,
                    std::size_t dimension) {
  double trace = 0.0;
  for (std::size_t a = 0; a < dimension; ++a) {
    trace += information[packed_index(a, a)] * inverse[packed_index(a, a)];
  }
  return static_cast<double>(dimension) * std::numeric_limits<double>::epsilon() * trace;
}

double gap_to_stop_at(double asked, double rounding) {
  return asked - std::min(rounding, 0.5 * asked);
}

Claim claim_at(double asked, double rounding) {
  if (rounding <= 0.5 * asked) return {};
  return {
      SolveStatus::kNumericalFailure,
      fmt::format("double precision knows the gap of this design only to about {:.1e}", rounding)};
}

void withdraw_unknowable_claim(std::size_t dimension, double asked_gap, Solution& solution) {
  if (solution.status != SolveStatus::kSolved) return;
  const auto d = static_cast<double>(dimension);
  Claim claim = claim_at(asked_gap, d * d * std::numeric_limits<double>::epsilon());
  solution.status = claim.status;
  if (solution.message.empty()) solution.message = std::move(claim.message);
}

}  // namespace graybox
