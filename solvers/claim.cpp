#include "graybox/solvers/claim.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "graybox/problems/packed_matrix.hpp"
#include "graybox/solvers/inverse_cholesky.hpp"
#include "graybox/solvers/sensitivity.hpp"

namespace graybox {

double gap_rounding(std::span<const double> information, std::span<const double> inverse,
                    std::size_t dimension) {
  double trace = 0.0;
  for (std::size_t a = 0; a < dimension; ++a) {
    trace += information[packed_index(a, a)] * inverse[packed_index(a, a)];
  }
  return static_cast<double>(dimension) * std::numeric_limits<double>::epsilon() * trace;
}

double gap_rounding(const InformationSet& set, std::span<const double> weights) {
  std::vector<double> information(set.packed_size());
  information_matrix(set, weights, information);
  InverseCholesky inverse(set.dimension());
  if (!inverse.factor(information)) return std::numeric_limits<double>::infinity();
  return gap_rounding(information, inverse.trace_dual(), set.dimension());
}

double gap_to_stop_at(double asked, double rounding) {
  return asked - std::min(rounding, 0.5 * asked);
}

void withdraw_unknowable_claim(const InformationSet& set, double asked_gap, Solution& solution) {
  if (solution.status != SolveStatus::kSolved ||
      solution.design.weights.size() != set.candidate_count()) {
    return;
  }
  const double rounding = gap_rounding(set, solution.design.weights);
  if (rounding <= 0.5 * asked_gap) return;
  solution.status = SolveStatus::kNumericalFailure;
  if (!solution.message.empty()) solution.message += "; ";
  solution.message += fmt::format(
      "double precision knows the gap of this design only to about {:.1e}", rounding);
}

}  // namespace graybox
