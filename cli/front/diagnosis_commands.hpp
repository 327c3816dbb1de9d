// The commands that need the diagnosis. A build without it (GRAYBOX_WITH_DIAGNOSIS=OFF) compiles
// without_diagnosis.cpp in place of diagnosis_commands.cpp. It adds none of them. It says so where
// one is asked for.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "cli/commands/commands.hpp"

namespace graybox::cli {

// Adds to `graybox` and to `graybox design`, which is there already.
void add_diagnosis_commands(CLI::App& app, Invocation& invocation);

// Why there is no such command ("diagnose", "design verify"). It is one line if the command needs
// the diagnosis that this build lacks, else nothing.
[[nodiscard]] std::string reason_for_absence(const std::string& command);

}  // namespace graybox::cli
