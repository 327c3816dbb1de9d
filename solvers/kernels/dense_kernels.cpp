#include "solvers/kernels/dense_kernels.hpp"

#include "problems/kernels/vector_width.hpp"

namespace graybox {
namespace dense_kernels_generic {
extern const DenseKernels kTable;
}
#if defined(__x86_64__)
namespace dense_kernels_avx2 {
extern const DenseKernels kTable;
}
namespace dense_kernels_avx512 {
extern const DenseKernels kTable;
}
#endif

const DenseKernels& dense_kernels() {
  switch (vector_width()) {
#if defined(__x86_64__)
    case VectorWidth::kAvx512:
      return dense_kernels_avx512::kTable;
    case VectorWidth::kAvx2:
      return dense_kernels_avx2::kTable;
#endif
    default:
      return dense_kernels_generic::kTable;
  }
}

}  // namespace graybox
