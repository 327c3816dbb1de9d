#include "problems/kernels/factor_kernels.hpp"

#include "problems/kernels/vector_width.hpp"

namespace graybox {
namespace factor_kernels_generic {
extern const FactorKernels kTable;
}
#if defined(__x86_64__)
namespace factor_kernels_avx2 {
extern const FactorKernels kTable;
}
namespace factor_kernels_avx512 {
extern const FactorKernels kTable;
}
#endif

const FactorKernels& factor_kernels() {
  switch (vector_width()) {
#if defined(__x86_64__)
    case VectorWidth::kAvx512:
      return factor_kernels_avx512::kTable;
    case VectorWidth::kAvx2:
      return factor_kernels_avx2::kTable;
#endif
    default:
      return factor_kernels_generic::kTable;
  }
}

}  // namespace graybox
