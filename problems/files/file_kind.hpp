// What a path names, without exceptions. With them std::filesystem throws on loops of links and on
// folders that may not be entered, which users would see as an internal error.
#pragma once

#include <filesystem>

namespace graybox {

// False also for what can't be looked at.
[[nodiscard]] bool is_file(const std::filesystem::path& path);
[[nodiscard]] bool is_folder(const std::filesystem::path& path);

// Throws InputError "PATH: no such file", "PATH: can't be opened: Too many levels of symbolic
// links" or "PATH: is no regular file; name the file itself".
void require_file(const std::filesystem::path& path);

}  // namespace graybox
