// Completion of the command line for bash, zsh and fish: a script that knows commands, options, the
// words that an option takes, and where a file comes. It starts no program when a key is pressed.
#pragma once

#include <string>
#include <string_view>

#include "cli/front/command_tree.hpp"

namespace graybox::cli {

// `shell`: bash, zsh or fish.
[[nodiscard]] std::string completion_script(const CommandNode& root, std::string_view shell);

}  // namespace graybox::cli
