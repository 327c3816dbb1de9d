// Distances |F (x_i - c - r)|^2 of many points x_i of n numbers, for a lower triangular F: the
// pricing of ellipsoids. Compiled for several vector widths and chosen at run time, as
// dense_kernels.hpp. A vector holds several points; each distance is computed alone, in an order
// that is fixed for a given vector width, so results do not depend on how the points are shared out
// among threads. Nothing allocates.
//
//   std::vector<double> panels(distance_panel_size(n)), workspace(distance_workspace_size(n));
//   pack_distance_panels(factor, n, panels.data());
//   distance_kernels().squared(points, count, n, c, r, panels.data(), workspace.data(), out);
#pragma once

#include <cstddef>

namespace graybox {

struct DistanceKernels {
  // out_i for `count` points, row-major. Two centres, c and r, since one number a coordinate is not
  // always enough: c holds its double, r what is left. About count n^2 flops.
  void (*squared)(const double* points, std::size_t count, std::size_t n, const double* centre,
                  const double* remainder, const double* panels, double* workspace, double* out);
};

// F in the order in which the kernels read it: four rows at a time, column by column, up to their
// diagonal; what is missing is zero. `factor` is the packed lower triangle.
[[nodiscard]] std::size_t distance_panel_size(std::size_t n);
void pack_distance_panels(const double* factor, std::size_t n, double* panels);

[[nodiscard]] std::size_t distance_workspace_size(std::size_t n);

// The widest set this processor runs (problems/kernels/vector_width.hpp).
[[nodiscard]] const DistanceKernels& distance_kernels();

}  // namespace graybox
