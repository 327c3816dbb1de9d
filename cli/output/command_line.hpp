// The command as it was typed, for reports.
#pragma once

#include <string>

namespace graybox::cli {

// "graybox diagnose 'my model.yaml' -o report"; the program by its name alone. Null-terminated
// arguments, as main's; empty for a null pointer.
[[nodiscard]] std::string command_line(const char* const* arguments);

}  // namespace graybox::cli
