#include "bench/study/process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>

#include "problems/base/error.hpp"

namespace graybox::bench {
namespace {

using Clock = std::chrono::steady_clock;
constexpr int kPollMilliseconds = 10;
constexpr std::size_t kErrorTail = 4096;

class Pipe {
 public:
  Pipe() {
    if (pipe2(ends_.data(), O_CLOEXEC) != 0) {
      throw InputError(fmt::format("no pipe for a child process: {}", std::strerror(errno)));
    }
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  ~Pipe() {
    close_end(0);
    close_end(1);
  }
  [[nodiscard]] int reader() const { return ends_[0]; }
  [[nodiscard]] int writer() const { return ends_[1]; }
  void close_end(std::size_t end) {
    if (ends_[end] >= 0) close(ends_[end]);
    ends_[end] = -1;
  }

  // Appends what is there without blocking; closes the reading end at end of file.
  void drain(std::string& text) {
    std::array<char, 65536> buffer;
    while (ends_[0] >= 0) {
      const ssize_t count = read(ends_[0], buffer.data(), buffer.size());
      if (count > 0) {
        text.append(buffer.data(), static_cast<std::size_t>(count));
      } else if (count == 0) {
        close_end(0);
      } else if (errno != EINTR) {
        return;  // EAGAIN: nothing more for now
      }
    }
  }

 private:
  std::array<int, 2> ends_{-1, -1};
};

// Everything the child needs is made before fork: afterwards only async-signal-safe calls.
struct ChildImage {
  std::vector<std::string> strings;
  std::vector<char*> arguments;
  std::vector<char*> environment;
};

ChildImage make_image(const ProcessRequest& request) {
  ChildImage image;
  image.strings = request.command;
  const std::size_t argument_count = image.strings.size();
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string_view text(*entry);
    const auto overridden = [&](const auto& pair) { return text.starts_with(pair.first + "="); };
    if (std::none_of(request.environment.begin(), request.environment.end(), overridden)) {
      image.strings.emplace_back(text);
    }
  }
  for (const auto& [name, value] : request.environment) image.strings.push_back(name + "=" + value);
  for (std::size_t i = 0; i < image.strings.size(); ++i) {
    (i < argument_count ? image.arguments : image.environment).push_back(image.strings[i].data());
  }
  image.arguments.push_back(nullptr);
  image.environment.push_back(nullptr);
  return image;
}

[[noreturn]] void become(const ChildImage& image, int output, int errors, pid_t parent) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(127);  // the parent died before prctl
  dup2(output, STDOUT_FILENO);
  dup2(errors, STDERR_FILENO);
  const int nothing = open("/dev/null", O_RDONLY);
  if (nothing >= 0) dup2(nothing, STDIN_FILENO);
  std::signal(SIGINT, SIG_DFL);
  execvpe(image.arguments[0], image.arguments.data(), image.environment.data());
  _exit(127);
}

std::size_t status_bytes(const std::string& process, std::string_view field) {
  std::ifstream file("/proc/" + process + "/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(field)) {
      return std::stoull(line.substr(line.find_first_of("0123456789"))) * 1024;
    }
  }
  return 0;
}

// What a process and all that it has started hold.
struct Memory {
  std::size_t now = 0;           // resident sets, summed; of the root the largest it ever had
  std::size_t largest_peak = 0;  // of one of them
};

Memory memory_of(pid_t root) {
  const std::size_t peak = peak_resident_bytes(std::to_string(root));
  Memory memory{peak, peak};
  for (const int process : descendants(root)) {
    const std::string name = std::to_string(process);
    memory.now += status_bytes(name, "VmRSS:");
    memory.largest_peak = std::max(memory.largest_peak, peak_resident_bytes(name));
  }
  return memory;
}

// A program of the user's leads a group of its own, and what a shell has started need not end with
// it.
void kill_all(pid_t root) {
  const std::vector<int> started = descendants(root);
  kill(-root, SIGKILL);
  for (const int process : started) kill(process, SIGKILL);
}

void keep_tail(std::string& text) {
  if (text.size() > kErrorTail) text.erase(0, text.size() - kErrorTail);
}

void set_nonblocking(int descriptor) {
  fcntl(descriptor, F_SETFL, fcntl(descriptor, F_GETFL) | O_NONBLOCK);
}

}  // namespace

std::size_t peak_resident_bytes(const std::string& process) {
  return status_bytes(process, "VmHWM:");
}

std::vector<int> descendants(int process) {
  std::vector<int> found;
  std::vector<int> open{process};
  while (!open.empty()) {
    const std::string tasks = fmt::format("/proc/{}/task", open.back());
    open.pop_back();
    std::error_code gone;  // processes and threads may end at any moment
    for (const auto& task : std::filesystem::directory_iterator(tasks, gone)) {
      std::ifstream children(task.path() / "children");
      for (int child = 0; children >> child;) {
        found.push_back(child);
        open.push_back(child);
      }
    }
  }
  return found;
}

ProcessOutcome run_process(const ProcessRequest& request) {
  const ChildImage image = make_image(request);
  Pipe output, errors;
  ProcessOutcome outcome;
  const pid_t parent = getpid();
  const auto start = Clock::now();
  const auto elapsed = [&] { return std::chrono::duration<double>(Clock::now() - start).count(); };
  const pid_t child = fork();
  if (child < 0) throw InputError(fmt::format("no child process: {}", std::strerror(errno)));
  if (child == 0) become(image, output.writer(), errors.writer(), parent);
  setpgid(child, child);  // in both processes, so that it is done before either goes on
  output.close_end(1);
  errors.close_end(1);
  set_nonblocking(output.reader());
  set_nonblocking(errors.reader());

  std::optional<ProcessEnding> killed;
  int status = 0;
  rusage usage{};
  while (wait4(child, &status, WNOHANG, &usage) == 0) {
    std::array<pollfd, 2> watched{pollfd{output.reader(), POLLIN, 0},
                                  pollfd{errors.reader(), POLLIN, 0}};
    // Once both ends are closed the child is about to end: look again at once, then rest.
    poll(watched.data(), watched.size(), kPollMilliseconds);
    output.drain(outcome.output);
    errors.drain(outcome.error_tail);
    keep_tail(outcome.error_tail);
    const Memory memory = memory_of(child);
    outcome.peak_memory_bytes = std::max(outcome.peak_memory_bytes, memory.largest_peak);
    if (killed) continue;
    if (elapsed() > request.time_limit) {
      killed = ProcessEnding::kTimeLimit;
    } else if (request.memory_limit > 0 && memory.now > request.memory_limit) {
      killed = ProcessEnding::kMemoryLimit;
    } else if (request.interrupted && request.interrupted()) {
      killed = ProcessEnding::kInterrupted;
    }
    if (killed) kill_all(child);
  }
  outcome.seconds = elapsed();
  kill(-child, SIGKILL);  // whatever the child has left behind
  output.drain(outcome.output);
  errors.drain(outcome.error_tail);
  keep_tail(outcome.error_tail);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  outcome.cpu_seconds = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  outcome.code = WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status);
  outcome.ending =
      killed.value_or(WIFSIGNALED(status) ? ProcessEnding::kSignalled : ProcessEnding::kExited);
  return outcome;
}

}  // namespace graybox::bench
