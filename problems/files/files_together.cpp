#include "problems/files/files_together.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

FilesTogether*& current_files() {
  static FilesTogether* instance = nullptr;
  return instance;
}

}  // namespace

FilesTogether::FilesTogether() { current_files() = this; }

FilesTogether::~FilesTogether() {
  current_files() = nullptr;
  for (const Waiting& file : waiting_) unlink(file.temporary.c_str());
}

bool FilesTogether::take(const std::string& temporary, const std::string& target,
                         const std::string& path) {
  if (current_files() == nullptr) return false;
  current_files()->waiting_.push_back({.temporary = temporary, .target = target, .path = path});
  return true;
}

void FilesTogether::commit() {
  for (; !waiting_.empty(); waiting_.erase(waiting_.begin())) {
    const Waiting& file = waiting_.front();
    if (const int reason = put_in_place(file.temporary, file.target); reason != 0) {
      throw InputError(fmt::format("{}: can't be written: {}", file.path, std::strerror(reason)));
    }
  }
}

int put_in_place(const std::string& temporary, const std::string& target) {
  if (std::rename(temporary.c_str(), target.c_str()) != 0) return errno;
  const std::filesystem::path folder = std::filesystem::path(target).parent_path();
  const int entries =
      open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (entries < 0) return 0;
  // Some file systems can't sync folders; that is no failure of the disk.
  const bool failed = fsync(entries) != 0 && errno != EINVAL && errno != ENOTSUP && errno != EROFS;
  const int reason = failed ? errno : 0;
  close(entries);
  return reason;
}

}  // namespace graybox
