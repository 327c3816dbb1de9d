#include "problems/files/input_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/mapped_numbers.hpp"
#include "problems/files/input_guard.hpp"

namespace graybox {
namespace {

constexpr std::size_t kAlwaysRead = std::size_t{16} << 20;  // bytes: no need to ask what is there

}  // namespace

InputFile::InputFile(std::string path, InputUse use) : path_(std::move(path)) {
  descriptor_ = open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor_ < 0) {
    throw InputError(fmt::format("{}: can't be opened: {}", path_, std::strerror(errno)));
  }
  struct stat status {};
  std::string problem;
  if (fstat(descriptor_, &status) != 0) {
    problem = std::strerror(errno);
  } else if (!S_ISREG(status.st_mode)) {
    problem = "is no regular file; name the file itself";
  } else if (status.st_size == 0) {
    problem = "the file is empty";
  }
  if (!problem.empty()) {
    close(descriptor_);
    throw InputError(fmt::format("{}: {}", path_, problem));
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
  if (use == InputUse::kInput) note_input(status);
}

InputFile::~InputFile() { close(descriptor_); }

void InputFile::read(std::uint64_t offset, void* bytes, std::size_t count) const {
  auto* target = static_cast<char*>(bytes);
  while (count > 0) {
    // The kernel moves at most 2 GiB at a time.
    const ssize_t got = pread(descriptor_, target, std::min(count, std::size_t{1} << 30),
                              static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      throw InputError(fmt::format("{}: can't be read: {}", path_, std::strerror(errno)));
    }
    if (got == 0) {
      throw InputError(
          fmt::format("{}: truncated: it ends at byte {}, {} more are expected; copy "
                      "it again",
                      path_, size_, count));
    }
    target += got;
    offset += static_cast<std::uint64_t>(got);
    count -= static_cast<std::size_t>(got);
  }
}

AlignedArray InputFile::numbers(std::uint64_t offset, std::size_t count) const {
  const std::size_t bytes = count * sizeof(double);
  if (offset > size_ || bytes > size_ - offset) {
    throw InputError(
        fmt::format("{}: truncated: it ends at byte {}, {} are expected from byte {} on; copy it "
                    "again",
                    path_, size_, bytes, offset));
  }
  if (bytes > kAlwaysRead && bytes > available_memory() / 2) {
    if (auto mapped = map_numbers(descriptor_, offset, count)) return *std::move(mapped);
    require_memory_for_numbers(static_cast<long double>(count), path_);
  }
  AlignedArray values(count);
  read(offset, values.data(), bytes);
  return values;
}

std::string InputFile::head(std::size_t count) const {
  std::string bytes(std::min<std::uint64_t>(count, size_), '\0');
  read(0, bytes.data(), bytes.size());
  return bytes;
}

}  // namespace graybox
