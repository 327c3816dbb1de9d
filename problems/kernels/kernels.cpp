#include "graybox/problems/kernels/kernels.hpp"

#include <cstdlib>
#include <string_view>

namespace graybox {
namespace kernels_generic {
extern const Kernels kTable;
}
#ifdef GRAYBOX_X86_64
namespace kernels_avx2 {
extern const Kernels kTable;
}
namespace kernels_avx512 {
extern const Kernels kTable;
}
#endif

namespace {

const Kernels& choose() {
#ifdef GRAYBOX_X86_64
  const char* wish = std::getenv("GRAYBOX_KERNELS");
  const std::string_view wanted = wish == nullptr ? "" : wish;
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq");
  if (wanted == "generic") return kernels_generic::kTable;
  if (avx512 && wanted != "avx2") return kernels_avx512::kTable;
  if (avx2) return kernels_avx2::kTable;
#endif
  return kernels_generic::kTable;
}

}  // namespace

const Kernels& kernels() {
  static const Kernels& chosen = choose();
  return chosen;
}

}  // namespace graybox
