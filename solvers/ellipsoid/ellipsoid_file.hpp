// Ellipsoids as JSON, format graybox-ellipsoid/1:
//
//   {
//     "format": "graybox-ellipsoid/1",
//     "points": "points.csv", "count": 1000, "dimension": 2, "names": ["x", "y"],
//     "centred": false, "status": "solved", "options": {"gap": 1e-06, ...},
//     "centre": [...], "centre_remainder": [...],
//     "factor": [[...], [...]],         F, lower triangular: |F (x - centre - remainder)| <= 1
//     "shape": [[...], [...]],          E = F^T F, for programs that want that
//     "semi_axes": [{"length": 2.0, "direction": [...]}, ...],
//     "log_volume": ..., "volume_bound": ..., "rounding_bound": ..., "largest_distance": ...,
//     "contact": [{"index": 17, "weight": 0.25, "distance": 1.0, "point": [...]}, ...],
//     "dropped": [{"index": 3, "weight": 0.33, "volume_factor": 0.4, "point": [...]}, ...],
//     "counters": {"rounds": ..., "passes": ..., "seconds": ...}
//   }
//
// Indices count rows from zero. "contact" lists the points that the ellipsoid touches, heaviest
// first; their weights prove the bound on the volume (ellipsoid_certificate.hpp). "dropped" lists
// points that were left out (outlier_peeling.hpp), where there are some. A program that
// writes ellipsoids for graybox needs "format", "centre" and "factor" or "shape"; all else is
// optional on reading.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "solvers/ellipsoid/outlier_peeling.hpp"

namespace graybox {

inline constexpr std::string_view kEllipsoidFormat = "graybox-ellipsoid/1";

[[nodiscard]] nlohmann::ordered_json ellipsoid_json(const PointSet& points,
                                                    const EllipsoidOptions& options,
                                                    const PeeledEllipsoid& found);

// What a file says; its claims are not read: certify_ellipsoid() is the one to ask.
struct EllipsoidFile {
  Ellipsoid ellipsoid;     // of a file with "shape" alone, that of its rounded Cholesky factor
  WeightedPoints support;  // empty where there is no "contact" with weights
  bool centred = false;
  std::vector<std::size_t> dropped;  // these need not be inside; no support
};

// Throws InputError, naming file and field, for anything that is no ellipsoid for these points.
[[nodiscard]] EllipsoidFile read_ellipsoid(const std::string& path, const PointSet& points);

}  // namespace graybox
