// Design: what a solver answers. Approximate designs are weights lambda on the simplex, one per
// candidate: lambda >= 0, sum lambda = 1 (paper, formula (9)).
#pragma once

#include <vector>

namespace graybox {

struct Design {
  std::vector<double> weights;  // length Q
};

}  // namespace graybox
