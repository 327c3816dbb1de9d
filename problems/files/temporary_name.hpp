// Names of files in the making, so that what a killed run leaves is told from results:
// `.NAME.graybox-PID-XXXXXX.tmp` beside NAME.
#pragma once

#include <filesystem>
#include <string>

namespace graybox {

// A pattern for mkstemps() with kTemporaryEnding.
[[nodiscard]] std::string temporary_pattern(const std::filesystem::path& target);
inline constexpr int kTemporaryEnding = 4;  // letters of ".tmp"

[[nodiscard]] bool is_temporary_name(const std::string& name);

// Removes the temporary files of runs that are gone. Each folder is searched once in a
// process. Folders that can't be read are left as they are.
void remove_leftovers(const std::filesystem::path& folder);

}  // namespace graybox
