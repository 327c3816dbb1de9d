// What `graybox ellipsoid` prints for people.
#pragma once

#include <string>
#include <vector>

#include "solvers/ellipsoid/outlier_peeling.hpp"

namespace graybox::cli {

// "1000 points in 2 dimensions".
[[nodiscard]] std::string describe_points(const PointSet& points);

// Status, volume and its bound, centre, semi-axes and work, a line each.
[[nodiscard]] std::string describe_ellipsoid(const PointSet& points,
                                             const EllipsoidOptions& options,
                                             const EllipsoidSolution& solution);

// The points that the ellipsoid touches, heaviest first.
[[nodiscard]] std::string describe_contact(const PointSet& points,
                                           const EllipsoidSolution& solution);

// The points left out, in that order, with what the volume became; empty where there are none.
[[nodiscard]] std::string describe_dropped(const PointSet& points,
                                           const std::vector<DroppedPoint>& dropped);

// Whether a given ellipsoid holds what it promises.
[[nodiscard]] std::string describe_check(const PointSet& points, double gap,
                                         const EllipsoidCertificate& certificate);

}  // namespace graybox::cli
