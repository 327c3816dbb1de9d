// One child process under hard limits: the fence around every run of the study.
//
//   const ProcessOutcome outcome = run_process({.command = {"/bin/sleep", "9"}, .time_limit =
//   0.5}); assert(outcome.ending == ProcessEnding::kTimeLimit);
//
// The child leads a process group of its own, so that Ctrl-C in a terminal reaches the study alone.
// A kill reaches whatever the child has started, in other groups, too. It dies with the parent.
// Time is wall time. Memory is the resident sets of the child and of all that it has started,
// looked at every 10 ms; the limit is therefore kept up to what they can touch in that time.
// (RLIMIT_AS would count address space that threads and BLAS reserve and never use, and sanitizers
// can't run under it.)
#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace graybox::bench {

struct ProcessRequest {
  std::vector<std::string> command{};  // path or name looked up in PATH, then its arguments
  std::vector<std::pair<std::string, std::string>> environment{};  // added to the parent's
  double time_limit = std::numeric_limits<double>::infinity();     // wall seconds, then SIGKILL
  std::size_t memory_limit = 0;                                    // resident bytes; 0: none
  std::function<bool()> interrupted{};                             // polled; true kills the child
};

enum class ProcessEnding {
  kExited,       // code: its exit code
  kSignalled,    // code: the signal, not sent by us
  kTimeLimit,    // killed by us
  kMemoryLimit,  // killed by us
  kInterrupted,  // killed by us
};

struct ProcessOutcome {
  ProcessEnding ending = ProcessEnding::kExited;
  int code = 0;
  std::string output;                 // all of standard output
  std::string error_tail;             // the last 4 kB of standard error
  double seconds = 0.0;               // wall, from fork to exit
  double cpu_seconds = 0.0;           // user and system, with waited-for children
  std::size_t peak_memory_bytes = 0;  // largest resident set of one process seen from outside
};

// Throws InputError if no process can be made. A command that can't be executed exits with 127.
[[nodiscard]] ProcessOutcome run_process(const ProcessRequest& request);

// The processes that one has started, and those that these have, as far as they are still its own.
[[nodiscard]] std::vector<int> descendants(int process);

// High-water mark of the resident set of a process (0 if it is gone); `process` is a pid or "self".
// Unlike ru_maxrss, it does not inherit the size of the parent across fork and exec.
[[nodiscard]] std::size_t peak_resident_bytes(const std::string& process = "self");

}  // namespace graybox::bench
