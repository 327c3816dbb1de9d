// A damaged file must not crash or hang the program that reads it. libhdf5 and matio do both on
// some damaged files (reads outside their buffers, endless loops), and nobody can tell from outside
// which. They therefore run in a process of their own, under limits of time and memory, which sends
// what it has read through a pipe:
//
//   ReadingProcess child({.name = "mat", .run = &send_mat}, {path, variable});
//   const std::uint64_t dimension = child.whole();
//
// A child that dies or finds no end becomes "damaged: copy it again". The file's data are read
// once: by the child or, where they lie in one piece, by the parent at the place that the child
// names (stored_set.hpp).
//
// The child is the program graybox_reader, freshly executed: it starts in less than half
// the time of graybox itself, whatever the size of the caller, and inherits no threads, locks or
// damaged memory. It is looked for beside the running program, in ../libexec/graybox, and where it
// was built and installed. Where it is not found or may not be executed (a sandbox, a program that
// was linked and moved), the child is a fork of the caller that runs the same task. That needs what
// glibc promises beyond POSIX, malloc and stdio in the child of a process with threads, and no
// other thread inside libhdf5.
//
// Limits: 3 s of processor time and 1 s more for every 4 MB of the file; 1 GiB of address space and
// 1032 bytes for each byte of the file (what deflate can make of it), but no more than is
// available.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/files/reading_message.hpp"

namespace graybox {

// The arguments are the file and what the task wants to know beside it. The task reads all that may
// fail before it sends the first word.
struct ReadingTask {
  const char* name;
  void (*run)(const std::vector<std::string>& arguments, MessageWriter& answer);
};

// Reads the child's answer. Throws InputError with one line if the child refuses the file or dies.
class ReadingProcess {
 public:
  ReadingProcess(const ReadingTask& task, const std::vector<std::string>& arguments);
  ReadingProcess(const ReadingProcess&) = delete;
  ReadingProcess& operator=(const ReadingProcess&) = delete;
  ~ReadingProcess();

  [[nodiscard]] std::uint64_t whole();
  [[nodiscard]] std::string text();
  [[nodiscard]] std::vector<std::string> texts();
  void numbers(double* values, std::size_t count);
  [[nodiscard]] AlignedArray numbers(std::size_t count);
  // Throws InputError if so many numbers don't fit; to be called before they are received.
  void require_memory(std::size_t count) const;

 private:
  [[nodiscard]] bool execute(const std::string& program, const ReadingTask& task,
                             const std::vector<std::string>& arguments);
  void fork_task(const ReadingTask& task, const std::vector<std::string>& arguments);
  void read_status();
  void end();
  [[noreturn]] void fail();

  std::string path_;
  pid_t child_ = -1;
  int descriptor_ = -1;
  int ending_ = 0;  // as waitpid gives it
};

// The child's part: sets the limits, runs the task and sends its answer. Returns the exit code.
int answer_reading(const ReadingTask& task, const std::vector<std::string>& arguments,
                   int descriptor);

}  // namespace graybox
