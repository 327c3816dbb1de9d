// The checker of enclosing ellipsoids. It alone decides whether an ellipsoid contains all points
// and how much smaller another could be; no solver's word is needed.
//
// Containment. Every |F (x_i - c)| is bounded from above, rounding included. All points are looked
// at in double precision, with one bound on the error for all,
//
//   gamma | |F| R |,   R_j = max_i |x_ij - c_j|,   gamma = (n + 8) 2^-53,
//
// and those that it leaves in question again in extended precision.
//
// Volume. Let u_k >= 0 with sum one be any weights of the points, S their second moments about
// their mean (centred: about the origin). An ellipsoid (x - b)^T A (x - b) <= 1 (centred: b = 0)
// that contains the points has
//
//   1 >= sum_k u_k (x_k - b)^T A (x_k - b) >= tr(A S) >= n det(A S)^(1/n),
//
// the last by the inequality of the arithmetic and geometric means. So its volume,
// V_n det A^(-1/2), is at least V_n n^(n/2) det S^(1/2): weak duality for the problem of
// smallest_ellipsoid.hpp, with equality at the optimum (Titterington 1975). With y_k = F (x_k - c),
// and ybar their mean (centred: zero),
//
//   log volume - log smallest volume <= -1/2 log det G,
//   G = n sum_k u_k (y_k - ybar)(y_k - ybar)^T,
//
// where G is near I whatever the coordinates are. G is formed in extended precision, with a bound
// on the error of its logarithmic determinant.
//
// Cost: one pass over the points, O(m n^2 + n^3) in extended precision for m weighted points, and
// n^2 for each point that double precision leaves in question.
#pragma once

#include <cstddef>

#include "solvers/ellipsoid/ellipsoid.hpp"
#include "solvers/ellipsoid/point_set.hpp"
#include "solvers/ellipsoid/support_frame.hpp"

namespace graybox {

struct EllipsoidCertificate {
  double largest_distance = 0.0;  // max_i |F (x_i - c)| is at most this, rounding included
  std::size_t farthest = 0;       // a point where the maximum is attained up to rounding
  double log_volume = 0.0;
  // The ellipsoid, scaled by largest_distance where that exceeds one, has at most
  // (1 + volume_bound) times the volume of the smallest one. Infinity where the weights prove
  // nothing.
  double volume_bound = 0.0;
  double rounding_bound = 0.0;  // the part of it that is rounding

  [[nodiscard]] bool contains_all() const { return largest_distance <= 1.0; }
};

// A pass that no clock stops. Weights need not be normalised; negative ones count as zero.
[[nodiscard]] EllipsoidCertificate certify_ellipsoid(const PointSet& points,
                                                     const Ellipsoid& ellipsoid,
                                                     const WeightedPoints& support, bool centred,
                                                     int threads);

}  // namespace graybox
