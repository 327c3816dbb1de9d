// PointSet: Q points of R^n, and the distances of all of them from an ellipsoid's centre.
//
//   const graybox::PointSet points = graybox::point_set(graybox::read_number_table("points.csv"));
//
// Throws InputError for fewer points than an ellipsoid needs, and for coordinates that are all
// equal or beyond what squares in double precision hold. Points in a common hyperplane are refused
// by who looks for it (spanning_points.hpp).
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "problems/base/stop.hpp"
#include "problems/formats/number_table.hpp"
#include "solvers/ellipsoid/ellipsoid.hpp"

namespace graybox {

struct PointSet {
  std::string path;
  std::vector<std::string> names;  // of the n coordinates
  std::size_t count = 0;           // Q
  std::size_t dimension = 0;       // n
  std::vector<double> values;      // row-major
  std::vector<double> lower;       // of each coordinate
  std::vector<double> upper;
  std::vector<std::size_t> lines;  // of the points in their file; empty where it has no lines

  [[nodiscard]] const double* point(std::size_t i) const { return values.data() + i * dimension; }
};

// Names x1, x2, ... where the table has none.
[[nodiscard]] PointSet point_set(NumberTable table, bool centred);

// Sets lower and upper.
void find_range(PointSet& points);

// The points listed, in that order; lower and upper stay those of all points.
[[nodiscard]] PointSet subset(const PointSet& points, std::span<const std::size_t> indices);

// out_i = |F (x_i - c)|^2 in double precision for all points. One read of the points, n^2 flops
// each, shared out among threads; the result does not depend on their number. False, with `out`
// incomplete, where the clock stops.
[[nodiscard]] bool squared_distances(const PointSet& points, const Ellipsoid& ellipsoid,
                                     int threads, const StopClock& clock, std::span<double> out);

}  // namespace graybox
