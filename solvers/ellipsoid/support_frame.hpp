// The ellipsoid of inertia of a few weighted points, and coordinates in which it is the unit ball.
//
// For points x_k with weights u_k >= 0 of sum one let
//
//   free     c = sum_k u_k x_k,   S = sum_k u_k (x_k - c)(x_k - c)^T
//   centred  c = 0,               S = sum_k u_k x_k x_k^T.
//
// The frame is the ellipsoid of F with F S F^T = I, so that D_i = |F (x_i - c)|^2 is the squared
// distance of a point in the metric of S. The design problem that is dual to the smallest ellipsoid
// (smallest_ellipsoid.hpp) has the sensitivities 1 + D_i (free) and D_i (centred).
//
// Arithmetic: the rows sqrt(u_k) (x_k - c) are factorised as Q R in extended precision, F = R^-T. S
// is not formed, so that F is good where S has a condition of up to 1e30. It is then rounded:
// whoever uses the frame uses that rounded F and the centre in two doubles.
//
// Cost: O(m n^2) in extended precision for m points.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "solvers/ellipsoid/ellipsoid.hpp"
#include "solvers/ellipsoid/point_set.hpp"

namespace graybox {

// Points with weights: the support of a design.
struct WeightedPoints {
  std::vector<std::size_t> indices;
  std::vector<double> weights;
};

// False where the points lie in a hyperplane (centred: through the origin) up to rounding.
[[nodiscard]] bool support_frame(const PointSet& points, const WeightedPoints& support,
                                 bool centred, Ellipsoid& frame);

// F (x_i - c), in extended precision, and a bound on the length of the error of that.
struct ExtendedPlace {
  std::vector<long double> y;
  long double error = 0;
};
void place_in_frame(const PointSet& points, std::size_t i, const Ellipsoid& frame,
                    ExtendedPlace& place);

}  // namespace graybox
