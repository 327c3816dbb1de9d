#include "problems/kernels/kernels.hpp"

#include "problems/kernels/vector_width.hpp"

namespace graybox {
namespace kernels_generic {
extern const Kernels kTable;
}
#if defined(__x86_64__)
namespace kernels_avx2 {
extern const Kernels kTable;
}
namespace kernels_avx512 {
extern const Kernels kTable;
}
#endif

const Kernels& kernels() {
  switch (vector_width()) {
#if defined(__x86_64__)
    case VectorWidth::kAvx512:
      return kernels_avx512::kTable;
    case VectorWidth::kAvx2:
      return kernels_avx2::kTable;
#endif
    default:
      return kernels_generic::kTable;
  }
}

}  // namespace graybox
