#include "problems/kernels/information_kernels.hpp"

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/vector_width.hpp"

namespace graybox {
namespace information_generic {
extern const InformationKernel kKernel;
}
#if defined(__x86_64__)
namespace information_avx2 {
extern const InformationKernel kKernel;
}
namespace information_avx512 {
extern const InformationKernel kKernel;
}
#endif

const InformationKernel& information_kernel() {
  switch (vector_width()) {
#if defined(__x86_64__)
    case VectorWidth::kAvx512:
      return information_avx512::kKernel;
    case VectorWidth::kAvx2:
      return information_avx2::kKernel;
#endif
    default:
      return information_generic::kKernel;
  }
}

// The arrays of struct Workspace in information_kernels_body.inc, for the widest vector.
std::size_t information_workspace_size(std::size_t bearings, std::size_t motors) {
  const std::size_t n = bearings + motors;
  const std::size_t complex_numbers = packed_size(n) + n + motors * motors +
                                      2 * packed_size(motors) + 2 * bearings * motors +
                                      2 * n * motors + 2 * motors;
  return (2 * complex_numbers + packed_size(n)) * InformationTables::kFrequencyPadding;
}

}  // namespace graybox
