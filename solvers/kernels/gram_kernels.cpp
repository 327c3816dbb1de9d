#include "solvers/kernels/gram_kernels.hpp"

#include "problems/kernels/vector_width.hpp"

namespace graybox {
namespace gram_kernels_generic {
extern const GramKernels kTable;
}
#if defined(__x86_64__)
namespace gram_kernels_avx2 {
extern const GramKernels kTable;
}
namespace gram_kernels_avx512 {
extern const GramKernels kTable;
}
#endif

// Both sizes cover the widest vectors (8 doubles), the deepest blocks and the largest tiles of
// gram_kernels_body.inc.
std::size_t gram_workspace_size(std::size_t n) {
  constexpr std::size_t kBlock = 128, kLargestTileRows = 12, kLargestTileColumns = 16;
  return kBlock * (n + kLargestTileColumns + kLargestTileRows);
}

std::size_t congruence_workspace_size(std::size_t d) { return 2 * 8 * d * d; }

const GramKernels& gram_kernels() {
  switch (vector_width()) {
#if defined(__x86_64__)
    case VectorWidth::kAvx512:
      return gram_kernels_avx512::kTable;
    case VectorWidth::kAvx2:
      return gram_kernels_avx2::kTable;
#endif
    default:
      return gram_kernels_generic::kTable;
  }
}

}  // namespace graybox
