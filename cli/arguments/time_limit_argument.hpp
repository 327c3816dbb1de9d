// --time-limit of commands whose work asks stop.hpp or has nothing to hand over before its end.
//
//   add_time_limit(*command, OnStop::kLosesNothing);
//
// The limit counts from parsing on, reading included. Once it has passed, a command that hands
// something over does so; another one ends within a second, with one line and exit code 1.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/process/interrupt.hpp"

namespace graybox::cli {

void add_time_limit(CLI::App& command, OnStop on_stop);

}  // namespace graybox::cli
