// What every command does first and last, graybox_mpi too.
#pragma once

namespace graybox::cli {

// States the commit, protects inputs from outputs, keeps libraries from printing, and lets writing
// past a file-size limit fail as a full disk does. Under a tight limit of memory it starts the
// program again, with one thread of BLAS. `arguments` is argv of main.
void start_up(char** arguments);

// Where it did, what the failed write threw is told once, by finish().
[[nodiscard]] bool standard_output_failed();

// The exit code in the end: kShort, with a line on stderr, where standard output did not take all.
[[nodiscard]] int finish(int exit_code, const char* program = "graybox");

}  // namespace graybox::cli
