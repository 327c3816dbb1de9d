// Confinement of a thread, and of every process it starts from then on, to some files and folders,
// by Linux's Landlock; needs no privileges and can't be undone. Processes inside also can't look
// into those outside (no tracing).
//
//   std::jthread([] {
//     const bool confined = confine_thread({{"/usr"}, {"answers/case_001"}}); ...
//   });
#pragma once

#include <filesystem>
#include <vector>

namespace graybox::bench {

struct OpenPaths {
  std::vector<std::filesystem::path> readable;  // and what lies below; may be executed
  std::vector<std::filesystem::path> writable;  // likewise, and may be changed
};

// What programs need: shared libraries, devices, the kernel's tables. Nothing of any user.
[[nodiscard]] std::vector<std::filesystem::path> system_paths();

// False, and nothing restricted, where the system can't do so. Paths that don't exist are passed
// over.
[[nodiscard]] bool confine_thread(const OpenPaths& paths);

}  // namespace graybox::bench
