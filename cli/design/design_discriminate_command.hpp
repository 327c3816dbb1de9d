// `graybox design discriminate`, for design_command.cpp alone.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/commands/commands.hpp"

namespace graybox::cli {

void add_design_discriminate_command(CLI::App& design, Invocation& invocation);

}  // namespace graybox::cli
