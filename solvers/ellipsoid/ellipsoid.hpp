// Ellipsoid: { x in R^n : |F (x - c)| <= 1 } for a lower triangular F with a positive diagonal,
// that is (x - c)^T E (x - c) <= 1 with the shape matrix E = F^T F. The factor is what is kept: its
// entries in double precision say more than those of E where the ellipsoid is thin. The centre is
// the sum of two doubles a coordinate, for points far from the origin.
//
//   const Ellipsoid disc{.dimension = 2, .centre = {0, 0}, .remainder = {0, 0},
//                        .factor = {1, 0, 1}};
//   log_volume(disc);   // log pi
#pragma once

#include <cstddef>
#include <vector>

namespace graybox {

struct Ellipsoid {
  std::size_t dimension = 0;      // n
  std::vector<double> centre;     // c, rounded
  std::vector<double> remainder;  // c minus that
  std::vector<double> factor;     // F, packed lower triangle, row by row
};

// Logarithm of the volume of the unit ball of R^n, and of the ellipsoid.
[[nodiscard]] double log_unit_ball_volume(std::size_t dimension);
[[nodiscard]] double log_volume(const Ellipsoid& ellipsoid);

// E, n x n row-major.
[[nodiscard]] std::vector<double> shape_matrix(const Ellipsoid& ellipsoid);

// F of the symmetric positive definite `shape` (n x n, row-major), packed; empty where it is not
// positive definite in extended precision.
[[nodiscard]] std::vector<double> factor_of_shape(const std::vector<double>& shape,
                                                  std::size_t dimension);

struct SemiAxis {
  double length = 0.0;
  std::vector<double> direction;  // unit vector; its largest entry is positive
};
// Longest first. O(n^3).
[[nodiscard]] std::vector<SemiAxis> semi_axes(const Ellipsoid& ellipsoid);

}  // namespace graybox
