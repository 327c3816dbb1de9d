#include "solvers/kernels/distance_kernels.hpp"

#include <algorithm>

#include "problems/kernels/vector_width.hpp"

namespace graybox {
namespace distance_kernels_generic {
extern const DistanceKernels kTable;
}
#if defined(__x86_64__)
namespace distance_kernels_avx2 {
extern const DistanceKernels kTable;
}
namespace distance_kernels_avx512 {
extern const DistanceKernels kTable;
}
#endif
namespace {

constexpr std::size_t kPanelRows = 4;
constexpr std::size_t kLargestBatch = 16;  // points

}  // namespace

std::size_t distance_panel_size(std::size_t n) {
  std::size_t size = 0;
  for (std::size_t row = 0; row < n; row += kPanelRows) {
    size += kPanelRows * std::min(n, row + kPanelRows);
  }
  return size;
}

void pack_distance_panels(const double* factor, std::size_t n, double* panels) {
  for (std::size_t row = 0; row < n; row += kPanelRows) {
    for (std::size_t column = 0; column < std::min(n, row + kPanelRows); ++column) {
      for (std::size_t k = row; k < row + kPanelRows; ++k) {
        *panels++ = k < n && column <= k ? factor[k * (k + 1) / 2 + column] : 0.0;
      }
    }
  }
}

std::size_t distance_workspace_size(std::size_t n) { return kLargestBatch * n; }

const DistanceKernels& distance_kernels() {
  switch (vector_width()) {
#if defined(__x86_64__)
    case VectorWidth::kAvx512:
      return distance_kernels_avx512::kTable;
    case VectorWidth::kAvx2:
      return distance_kernels_avx2::kTable;
#endif
    default:
      return distance_kernels_generic::kTable;
  }
}

}  // namespace graybox
