// smallest_ellipsoid: the ellipsoid of least volume that contains given points.
//
//   minimise  log vol { x : |F (x - c)| <= 1 }   subject to  |F (x_i - c)| <= 1,  i = 1 .. Q,
//
// with a free centre, or centred: c = 0. Its dual is D-optimal design (Titterington 1975; Khachiyan
// 1996; Todd 2016, "Minimum-Volume Ellipsoids"): with the rank-one matrices H_i = q_i q_i^T of the
// lifted points q_i = (x_i, 1), d = n + 1 (free), or q_i = x_i, d = n (centred),
//
//   maximise  log det M(u),  M(u) = sum_i u_i q_i q_i^T,   u >= 0,  sum_i u_i = 1.
//
// The ellipsoid of inertia of the optimal u (support_frame.hpp), scaled by sqrt(n), is the smallest
// ellipsoid. The weight u_i is positive only where it touches x_i. Let D_i be the squared distances
// in the metric of S(u), for any u. They are the sensitivities: q_i^T M^-1 q_i = 1 + D_i (free) or
// D_i (centred). Scaled to contain all points, the ellipsoid of any u has at most
// (max_i D_i / n)^(n/2) times the least volume (ellipsoid_certificate.hpp).
//
// The method is column generation (column_generation.hpp) with points in place of matrices: Q n
// numbers are stored and read, not Q n^2 / 2. It prices points and adds the farthest to a working
// set. On that it solves the design problem by Newton's method (working_set.hpp). It does so on
// samples, then on short lists of the farthest points, and prices all points between. Each time the
// frame of the present weights is computed anew in extended precision. In that frame M = I, so
// neither offsets nor correlations of the coordinates cost digits.
//
//   const PointSet points = point_set(read_number_table("points.csv"), false);
//   const EllipsoidSolution found = smallest_ellipsoid(points, {.gap = 1e-9});
//   assert(found.certificate.contains_all() && found.certificate.volume_bound <= 1e-9);
//
// Cost: a handful of passes of n^2 flops a point. A Newton step on m points costs
// m d^3 + m^2 d^2 / 4 + m^3; m is from 2 d to some d^2. Memory: 8 Q bytes beyond the points, and
// some 32 d^3 + 8 m^2. Results do not depend on the number of threads.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "solvers/ellipsoid/ellipsoid.hpp"
#include "solvers/ellipsoid/ellipsoid_certificate.hpp"
#include "solvers/ellipsoid/point_set.hpp"
#include "solvers/ellipsoid/support_frame.hpp"

namespace graybox {

struct EllipsoidOptions {
  bool centred = false;
  double gap = 1e-6;  // proven: volume at most 1 + gap times the least; > 0
  double time_limit = std::numeric_limits<double>::infinity();  // wall seconds
  int threads = 1;
  std::uint64_t seed = 1;  // of samples
};

enum class EllipsoidStatus : std::int8_t {
  kSolved,            // certificate.volume_bound <= gap
  kTimeLimit,         // time or Ctrl-C; the best ellipsoid so far, which contains all points
  kNumericalFailure,  // rounding keeps the bound above the gap; likewise
};
[[nodiscard]] std::string_view to_string(EllipsoidStatus status);

struct EllipsoidSolution {
  Ellipsoid ellipsoid;     // contains all points, for certain
  WeightedPoints support;  // points it touches, with the weights that prove the bound
  EllipsoidCertificate certificate;
  EllipsoidStatus status = EllipsoidStatus::kNumericalFailure;
  double seconds = 0.0;
  double passes = 0.0;      // points read, over Q; the start and the certificate included
  std::int64_t rounds = 0;  // of the working set
};

// Throws InputError where the points lie in a hyperplane or an option is out of range, and Stopped
// where it was stopped before the first pass over all points.
[[nodiscard]] EllipsoidSolution smallest_ellipsoid(const PointSet& points,
                                                   const EllipsoidOptions& options);

}  // namespace graybox
