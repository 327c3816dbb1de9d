#include "solvers/core/lapack.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <mutex>
#include <vector>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"

namespace graybox::lapack {
namespace {

// What OpenBLAS takes and gives back its buffers with. It keeps for the next call what was given
// back. Another BLAS has neither.
using Take = void* (*)(int);
using GiveBack = void (*)(void*);

}  // namespace

void require_room(int callers) {
  static std::mutex mutex;
  static std::size_t held = 0;
  const std::size_t asked = static_cast<std::size_t>(std::max(1, callers));
  const std::scoped_lock lock(mutex);
  if (asked <= held || process_limit() == std::numeric_limits<std::size_t>::max()) return;
  const auto take = reinterpret_cast<Take>(dlsym(RTLD_DEFAULT, "blas_memory_alloc"));
  const auto give_back = reinterpret_cast<GiveBack>(dlsym(RTLD_DEFAULT, "blas_memory_free"));
  if (take == nullptr || give_back == nullptr) return;
  constexpr std::size_t kBeside = std::size_t{1} << 20;
  const std::size_t needed = (asked - held) * kBuffer + kBeside;
  if (const std::size_t room = room_in_process_limits(); needed > room) {
    throw InputError(fmt::format(
        "BLAS, which this solver uses, needs {:.2g} bytes of memory, {:.2g} are left of this "
        "process's limit (ulimit -d, -v); use column_generation, fewer threads, or a limit with "
        "more",
        static_cast<double>(needed), static_cast<double>(room)));
  }
  std::vector<void*> buffers(asked);
  for (void*& buffer : buffers) buffer = take(0);
  for (void* buffer : buffers) give_back(buffer);
  held = asked;
}

}  // namespace graybox::lapack
