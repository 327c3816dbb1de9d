#include "graybox/bench/pin_threads.hpp"

#include <unistd.h>

#include <cstdlib>
#include <string>

namespace graybox::bench {

void pin_threads(int threads, char** arguments) {
  if (threads < 1) return;  // the solver refuses it by name
  const std::string count = std::to_string(threads);
  bool changed = false;
  for (const char* name : {"OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"}) {
    if (std::getenv(name) != nullptr) continue;
    setenv(name, count.c_str(), 0);
    changed = true;
  }
  if (changed)
    execv("/proc/self/exe", arguments);  // returns only if it failed: then slower, not wrong
}

}  // namespace graybox::bench
