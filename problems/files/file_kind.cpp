#include "problems/files/file_kind.hpp"

#include <fmt/format.h>

#include "problems/base/error.hpp"

namespace graybox {

namespace fs = std::filesystem;

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

void require_file(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_regular_file(status)) return;
  if (status.type() == fs::file_type::not_found) {
    throw InputError(fmt::format("{}: no such file", path.string()));
  }
  if (error) {
    throw InputError(fmt::format("{}: can't be opened: {}", path.string(), error.message()));
  }
  throw InputError(fmt::format("{}: is no regular file; name the file itself", path.string()));
}

}  // namespace graybox
