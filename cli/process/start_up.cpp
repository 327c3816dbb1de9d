#include "cli/process/start_up.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "cli/process/build_commit.hpp"
#include "cli/process/exit_code.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/input_guard.hpp"
#include "problems/formats/quiet_hdf5.hpp"

namespace graybox::cli {
namespace {

// Else the next file that is opened takes the place of a closed standard stream, and gets its text.
// Opened for reading: writing to it fails, as it should.
void hold_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) < 0 && errno == EBADF) (void)open("/dev/null", O_RDONLY);
  }
}

}  // namespace

void start_up() {
  hold_standard_streams();
  std::signal(SIGXFSZ, SIG_IGN);
  set_program_commit(kBuildCommit);
  answer_interrupts();
  protect_inputs();
  silence_hdf5();
}

bool standard_output_failed() { return std::ferror(stdout) != 0; }

int finish(int exit_code, const char* program) {
  errno = 0;
  const bool flushed = std::fflush(stdout) == 0;
  if (flushed && !standard_output_failed()) return exit_code;
  std::fprintf(stderr, "%s: standard output can't be written: %s\n", program,
               errno != 0 ? std::strerror(errno) : "disk full?");
  return exit_code == kDone ? kShort : exit_code;
}

}  // namespace graybox::cli
