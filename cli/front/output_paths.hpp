// What a command line says it writes, held to two rules before anything is read or written, for
// every command alike:
//
//   no two outputs are one file (or folder): the second would replace the first
//   no output is a file that the command reads
//
// Files are told apart by what they are, not by how they are spelled: links and other spellings
// make no difference. Devices and pipes (/dev/null) may be named as often as one likes. An option
// writes if its name says so (--output, --report, ...) or its description begins with "write".
// Inputs that other files name (the recordings of a campaign) are guarded where they are read
// (problems/files/input_guard.hpp).
//
//   app.parse_complete_callback([&app] { require_distinct_outputs(app); });
#pragma once

#include <CLI/CLI.hpp>

namespace graybox::cli {

// Asks the commands that were parsed. Throws InputError naming the file and the options.
void require_distinct_outputs(const CLI::App& app);

}  // namespace graybox::cli
