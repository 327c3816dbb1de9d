// --threads of commands whose answer does not depend on it.
//
//   add_threads(*command, options.threads);
//
// Unless a number is stated, a command takes as many threads as it may use cores: of the computer,
// or of those that `taskset` and batch systems leave to it.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace graybox::cli {

// Adds the option and sets `threads` to its default.
void add_threads(CLI::App& command, int& threads, const std::string& words = "threads");

}  // namespace graybox::cli
