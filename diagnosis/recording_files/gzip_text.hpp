// The text in a gzip file, unpacked in memory (zlib). Several members one after the other are one
// text, as gzip -d has it.
//
// Memory: the text, in doubling steps, each asked for before it is taken (available_memory.hpp), so
// a small file that unpacks to more than there is is refused and not unpacked to the end.
#pragma once

#include <string>

namespace graybox {

// Throws InputError with one line: missing, no gzip file, truncated, damaged, or too large.
[[nodiscard]] std::string unpacked_gzip(const std::string& path);

}  // namespace graybox
