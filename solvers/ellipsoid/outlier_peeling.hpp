// The smallest ellipsoid around all points but a few: points that hold the ellipsoid are left out
// one after the other (ellipsoidal peeling: Titterington 1978; Silverman and Titterington 1980).
//
// Which to leave out: of the ten with the largest weights the one without which the ellipsoid is
// smallest. A weight is at most 1 / d, d = n + 1 (centred: n), and a point that alone holds the
// ellipsoid in some direction has that. The choice is greedy: nothing is proven of other choices of
// as many points, which are too many to try.
#pragma once

#include <cstddef>
#include <vector>

#include "solvers/ellipsoid/smallest_ellipsoid.hpp"

namespace graybox {

struct DroppedPoint {
  std::size_t index = 0;
  double weight = 0.0;         // when it was left out
  double volume_factor = 1.0;  // volume of the smallest ellipsoid without it over that with it
};

struct PeeledEllipsoid {
  EllipsoidSolution solution;  // of the points that are left; indices are those of all points
  std::vector<DroppedPoint> dropped;
};

// Leaves out `count` points, or fewer where time is up. Throws as smallest_ellipsoid(), also where
// too few points are left. Cost: 10 count + 1 times that of smallest_ellipsoid().
[[nodiscard]] PeeledEllipsoid peeled_ellipsoid(const PointSet& points,
                                               const EllipsoidOptions& options, std::size_t count);

// The points without those listed (ascending or not), and where each of them stood.
struct RemainingPoints {
  PointSet points;
  std::vector<std::size_t> indices;
};
[[nodiscard]] RemainingPoints points_without(const PointSet& points,
                                             const std::vector<std::size_t>& dropped);

}  // namespace graybox
