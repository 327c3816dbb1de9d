// Design: what a solver answers. Approximate designs are weights lambda on the simplex, one per
// candidate: lambda >= 0, sum lambda = 1 (paper, formula (9)).
#pragma once

#include <vector>

namespace graybox {

struct Design {
  std::vector<double> weights;  // length Q
  // Criterion E only, and optional: the dual solution E >= 0, tr E = 1, that proves the design good
  // (certificate.hpp), as a packed lower triangle of p numbers.
  std::vector<double> dual_matrix = {};
  // Criterion G over a region only, and optional: a weight for each point of the region, of sum
  // one, that proves the design good.
  std::vector<double> dual_weights = {};
};

}  // namespace graybox
