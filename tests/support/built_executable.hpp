// Where the executables of this build tree stand, found at run time: nothing of the build tree's
// path is compiled in, so that two builds share a test's object file.
#pragma once

#include <filesystem>
#include <string>

namespace graybox::testing {

// The path of an executable given relative to the build tree, such as "bin/graybox". Tests stand
// one folder below its root.
inline std::string built_executable(const std::string& relative) {
  const std::filesystem::path test = std::filesystem::read_symlink("/proc/self/exe");
  return (test.parent_path().parent_path() / relative).string();
}

}  // namespace graybox::testing
