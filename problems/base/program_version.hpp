// Which graybox this is; stated in every file that it writes.
#pragma once

#include <cstddef>
#include <string>

namespace graybox {

// "0.3.0".
[[nodiscard]] const char* program_version();

// The git commit that the program was built from, twelve digits and "+" where files were changed,
// or
// "unknown". The commands state theirs at their start; in other programs it is unknown.
[[nodiscard]] const std::string& program_commit();
// Blanks at its end don't count.
void set_program_commit(const std::string& commit);

// Bytes that the commit takes in the program, blanks included.
inline constexpr std::size_t kCommitField = 13;

// "graybox 0.3.0 (commit 33c485e51c2a)".
[[nodiscard]] std::string written_by();

}  // namespace graybox
