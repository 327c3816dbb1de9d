#include "problems/files/folder_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <thread>

#include "problems/base/error.hpp"
#include "problems/files/temporary_name.hpp"

namespace graybox {
namespace {

// A process that a killed run was just starting holds the run's lock until it executes its own
// program. So a lock that is taken is asked for again, for up to two seconds.
bool take_lock(int descriptor) {
  constexpr std::chrono::milliseconds kPause{50};
  constexpr int kAttempts = 40;
  for (int attempt = 1; flock(descriptor, LOCK_EX | LOCK_NB) != 0; ++attempt) {
    if (errno != EWOULDBLOCK) return true;  // no locks here, as on some network drives
    if (attempt == kAttempts) return false;
    std::this_thread::sleep_for(kPause);
  }
  return true;
}

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw InputError(fmt::format("{}: can't be made: {}", folder.string(), error.message()));
  }
  descriptor_ = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor_ >= 0 && !take_lock(descriptor_)) {
    close(descriptor_);
    throw InputError(
        fmt::format("{}: another graybox command is writing into this folder; wait until it has "
                    "ended, or choose another folder",
                    folder.string()));
  }
  remove_leftovers(folder);
}

FolderLock::~FolderLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace graybox
