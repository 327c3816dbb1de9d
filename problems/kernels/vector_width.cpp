#include "problems/kernels/vector_width.hpp"

#include <cstdlib>
#include <string_view>

namespace graybox {
namespace {

VectorWidth detect() {
#if defined(__x86_64__)
  const char* wish = std::getenv("GRAYBOX_KERNELS");
  const std::string_view wanted = wish == nullptr ? "" : wish;
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  if (wanted == "generic") return VectorWidth::kGeneric;
  if (avx512 && wanted != "avx2") return VectorWidth::kAvx512;
  if (avx2) return VectorWidth::kAvx2;
#endif
  return VectorWidth::kGeneric;
}

}  // namespace

VectorWidth vector_width() {
  static const VectorWidth width = detect();
  return width;
}

}  // namespace graybox
