#include "graybox/problems/formats/atomic_file.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

#include "graybox/problems/error.hpp"

namespace graybox {

AtomicFile::AtomicFile(std::string path) : path_(std::move(path)) {
  if (path_.empty()) throw InputError("the name of the file to write is empty");
  std::error_code ignored;
  if (std::filesystem::is_directory(path_, ignored)) {
    throw InputError(fmt::format("{}: is a folder; name a file in it", path_));
  }
  temporary_ = path_ + ".XXXXXX";
  const int descriptor = mkstemp(temporary_.data());
  if (descriptor < 0) {
    throw InputError(fmt::format("{}: can't be written: {}", path_, std::strerror(errno)));
  }
  // mkstemp makes private files; results are as public as any other file of the user.
  const mode_t mask = umask(0);
  umask(mask);
  const int changed = fchmod(descriptor, 0666 & ~mask);
  close(descriptor);
  if (changed != 0) {
    unlink(temporary_.c_str());
    throw InputError(fmt::format("{}: can't be written: {}", path_, std::strerror(errno)));
  }
}

AtomicFile::~AtomicFile() {
  if (!committed_) unlink(temporary_.c_str());
}

void AtomicFile::commit() {
  if (std::rename(temporary_.c_str(), path_.c_str()) != 0) {
    throw InputError(fmt::format("{}: can't be written: {}", path_, std::strerror(errno)));
  }
  committed_ = true;
}

void write_text_file(const std::string& path, std::string_view text) {
  AtomicFile file(path);
  {
    std::ofstream stream(file.temporary(), std::ios::binary);
    stream.write(text.data(), static_cast<std::streamsize>(text.size()));
    stream.close();
    if (!stream) throw InputError(fmt::format("{}: can't be written: disk full?", path));
  }
  file.commit();
}

}  // namespace graybox
