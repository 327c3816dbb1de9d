// Points to start from: at most 2 n that no hyperplane contains, farthest apart in n directions
// (Kumar and Yildirim 2005, algorithm 3.1, after Betke and Henk 1993). The smallest ellipsoid
// around them has at least n^(-O(n)) of the volume of that around all points, whatever these are.
//
// Coordinates are scaled to their range first. A direction in which all points agree up to the
// rounding of their own coordinates counts as one in which they agree. Cost: n passes over the
// points of n flops each.
#pragma once

#include <cstddef>
#include <vector>

#include "solvers/ellipsoid/point_set.hpp"

namespace graybox {

struct SpanningPoints {
  std::vector<std::size_t> indices;  // without repetition
  // Where the points lie in a hyperplane (centred: through the origin): the coordinate that the
  // others determine best. Otherwise n.
  std::size_t dependent = 0;
};

[[nodiscard]] SpanningPoints spanning_points(const PointSet& points, bool centred);

}  // namespace graybox
