#include "cli/process/start_up.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "cli/process/build_commit.hpp"
#include "cli/process/exit_code.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/input_guard.hpp"
#include "problems/formats/quiet_hdf5.hpp"
#include "solvers/core/lapack.hpp"

namespace graybox::cli {
namespace {

// Else the next file that is opened takes the place of a closed standard stream, and gets its text.
// Opened for reading: writing to it fails, as it should.
void hold_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) < 0 && errno == EBADF) (void)open("/dev/null", O_RDONLY);
  }
}

// OpenBLAS starts a thread for each processor when the program is loaded. Each takes a buffer, and
// asks for it without end where a limit (ulimit -d, -v) refuses it; the program then never ends.
// Where the buffers would take much of the limit, the program starts itself again with one thread.
void keep_blas_within_limits(char** arguments) {
  constexpr const char* kName = "OPENBLAS_NUM_THREADS";
  const auto processors = static_cast<std::size_t>(std::max(1L, sysconf(_SC_NPROCESSORS_ONLN)));
  if (process_limit() / 4 >= processors * lapack::kBuffer) return;
  const char* set = std::getenv(kName);
  if (set != nullptr && std::strcmp(set, "1") == 0) return;
  setenv(kName, "1", 1);
  execv("/proc/self/exe", arguments);
}

}  // namespace

void start_up(char** arguments) {
  keep_blas_within_limits(arguments);
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
