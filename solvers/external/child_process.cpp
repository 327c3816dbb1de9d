#include "solvers/external/child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#ifdef __linux__
#include <sys/prctl.h>
#endif

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr int kCannotRun = 127;  // as shells have it

// In the new process, between fork and exec: only system calls are allowed here.
[[noreturn]] void become(char* const* arguments, int log, pid_t parent) {
  setpgid(0, 0);
#ifdef __linux__
  prctl(PR_SET_PDEATHSIG, SIGKILL);
#endif
  const int nothing = open("/dev/null", O_RDONLY);
  if (getppid() != parent || nothing < 0) _exit(kCannotRun);
  dup2(nothing, STDIN_FILENO);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  execvp(arguments[0], arguments);
  _exit(kCannotRun);
}

}  // namespace

ChildProcess::ChildProcess(const std::vector<std::string>& arguments, const std::string& log) {
  std::vector<char*> pointers;
  for (const std::string& argument : arguments) {
    pointers.push_back(const_cast<char*>(argument.c_str()));  // execvp takes but doesn't write them
  }
  pointers.push_back(nullptr);
  const int descriptor = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (descriptor < 0) {
    throw InputError(fmt::format("{}: can't be written: {}", log, std::strerror(errno)));
  }
  const pid_t parent = getpid();
  process_ = fork();
  const int error = errno;
  if (process_ == 0) become(pointers.data(), descriptor, parent);
  close(descriptor);
  if (process_ < 0) {
    throw InputError(fmt::format("{}: can't be started: {}", arguments[0], std::strerror(error)));
  }
  setpgid(process_, process_);  // whoever of the two comes first
#ifdef SYS_pidfd_open
  end_ = static_cast<int>(syscall(SYS_pidfd_open, process_, 0));
#endif
}

ChildProcess::~ChildProcess() {
  kill();
  if (end_ >= 0) close(end_);
}

void ChildProcess::wait(double seconds) const {
  pollfd end{.fd = end_, .events = POLLIN, .revents = 0};  // poll() passes over a negative one
  poll(&end, 1, static_cast<int>(std::ceil(1000.0 * seconds)));
}

bool ChildProcess::running() {
  if (ended_) return false;
  int status = 0;
  if (waitpid(process_, &status, WNOHANG) == 0) return true;
  take_status(status);
  return false;
}

void ChildProcess::kill() {
  ::kill(-process_, SIGKILL);  // also what the leader has left behind
  if (ended_) return;
  int status = 0;
  while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  take_status(status);
}

void ChildProcess::take_status(int status) {
  ended_ = true;
  exit_code_ = WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

}  // namespace graybox
