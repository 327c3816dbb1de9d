#include "bench/pin_threads.hpp"

#include <unistd.h>

#include <cstdlib>
#include <string>
#include <utility>

namespace graybox::bench {

void pin_threads(int threads, char** arguments) {
  if (threads < 1) return;  // the solver refuses it by name
  const std::string count = std::to_string(threads);
  bool changed = false;
  for (const auto& [name, value] :
       {std::pair{"OPENBLAS_NUM_THREADS", std::string("1")}, std::pair{"OMP_NUM_THREADS", count}}) {
    if (std::getenv(name) != nullptr) continue;
    setenv(name, value.c_str(), 0);
    changed = true;
  }
  if (changed)
    execv("/proc/self/exe", arguments);  // returns only if it failed: then slower, not wrong
}

}  // namespace graybox::bench
