#include "problems/files/reading_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <utility>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"
#include "problems/files/input_guard.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

// Changes with what the child sends, so that a reader of another version is not understood wrongly.
constexpr std::uint64_t kProtocol = 0x6772617962783031;
constexpr const char* kProgram = "graybox_reader";

constexpr std::size_t kSmall = 1'000'000;  // numbers
#ifndef GRAYBOX_READER_SECONDS             // the fuzzer has less patience
#define GRAYBOX_READER_SECONDS 3
#endif
constexpr std::uint64_t kSeconds = GRAYBOX_READER_SECONDS;
constexpr std::uint64_t kBytesPerSecond = 4'000'000;
constexpr std::uint64_t kMemory = std::uint64_t{1} << 30;
constexpr std::uint64_t kExpansion = 1032;

// Sanitizers reserve terabytes of address space.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif
#else
constexpr bool kSanitized = false;
#endif

void limit(decltype(RLIMIT_CPU) resource, std::uint64_t value) {
  rlimit bounds{};
  if (getrlimit(resource, &bounds) != 0) return;
  bounds.rlim_cur = std::min<rlim_t>(value, bounds.rlim_max);
  setrlimit(resource, &bounds);
}

void set_limits(const std::string& path) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  limit(RLIMIT_CORE, 0);
  // Ctrl-C is for the parent, which waits for the answer and then ends in its own way.
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGHUP, SIG_IGN);
  std::signal(SIGXCPU, SIG_DFL);
  const std::uint64_t size = InputFile(path).size();
  limit(RLIMIT_CPU, kSeconds + size / kBytesPerSecond);
  if (kSanitized) return;
  const std::uint64_t bytes =
      std::min<std::uint64_t>(kMemory + kExpansion * size, available_memory());
  limit(RLIMIT_AS, used_address_space() + bytes);
}

std::vector<fs::path> possible_programs() {
  std::vector<fs::path> programs;
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (!error) {
    programs.push_back(self.parent_path() / kProgram);
    programs.push_back(self.parent_path().parent_path() / "libexec" / "graybox" / kProgram);
  }
  programs.emplace_back(fs::path(GRAYBOX_READER_BUILD_FOLDER) / kProgram);
  programs.emplace_back(fs::path(GRAYBOX_READER_INSTALL_FOLDER) / kProgram);
  return programs;
}

// Empty if there is none.
const std::string& reader_program() {
  static const std::string program = [] {
    for (const fs::path& candidate : possible_programs()) {
      if (access(candidate.c_str(), X_OK) == 0) return candidate.string();
    }
    return std::string();
  }();
  return program;
}

struct Pipe {
  int reading = -1;
  int writing = -1;
};

Pipe open_pipe(const std::string& path) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw InputError(fmt::format("{}: can't be read: no pipe to the process that reads it: {}",
                                 path, std::strerror(errno)));
  }
  fcntl(ends[1], F_SETPIPE_SZ, 1 << 20);  // a hint: failure costs only speed
  return {ends[0], ends[1]};
}

}  // namespace

ReadingProcess::ReadingProcess(const ReadingTask& task, const std::vector<std::string>& arguments)
    : path_(arguments.front()) {
  note_input(path_);                   // the child opens it, but this process may write over it
  { const InputFile present(path_); }  // missing, a folder, empty
  if (reader_program().empty() || !execute(reader_program(), task, arguments)) {
    fork_task(task, arguments);
  }
  try {
    read_status();
  } catch (...) {
    end();
    throw;
  }
}

ReadingProcess::~ReadingProcess() { end(); }

bool ReadingProcess::execute(const std::string& program, const ReadingTask& task,
                             const std::vector<std::string>& arguments) {
  std::vector<std::string> words{program, task.name};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  const Pipe pipe = open_pipe(path_);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe.writing, STDOUT_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  const int failure =
      posix_spawn(&child_, program.c_str(), &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(pipe.writing);
  descriptor_ = pipe.reading;
  if (failure != 0) child_ = -1;
  std::uint64_t protocol = 0;
  if (failure == 0 && MessageReader(descriptor_).whole(protocol) && protocol == kProtocol) {
    return true;
  }
  end();
  return false;
}

void ReadingProcess::fork_task(const ReadingTask& task, const std::vector<std::string>& arguments) {
  const Pipe pipe = open_pipe(path_);
  child_ = fork();
  if (child_ == 0) {
    const int nothing = open("/dev/null", O_RDWR | O_CLOEXEC);
    // The parent's handlers are not for this process: a crash here only ends it.
    for (int number = 1; number < NSIG; ++number) std::signal(number, SIG_DFL);
    for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
      dup2(nothing, standard);
    }
    _exit(answer_reading(task, arguments, pipe.writing));
  }
  close(pipe.writing);
  descriptor_ = pipe.reading;
  if (child_ < 0) {
    const int failure = errno;
    end();
    throw InputError(fmt::format("{}: can't be read: no process can be started: {}", path_,
                                 std::strerror(failure)));
  }
  std::uint64_t protocol = 0;
  if (!MessageReader(descriptor_).whole(protocol)) fail();
}

void ReadingProcess::read_status() {
  const std::uint64_t status = whole();
  if (status == static_cast<std::uint64_t>(ReadingStatus::kRead)) return;
  if (status == static_cast<std::uint64_t>(ReadingStatus::kRefused)) throw InputError(text());
  throw InputError(fmt::format(
      "{}: damaged: its contents make no sense, or take more memory than the {:.2g} bytes that are "
      "there; copy it again, or write it anew",
      path_, static_cast<double>(available_memory())));
}

void ReadingProcess::end() {
  if (descriptor_ >= 0) close(std::exchange(descriptor_, -1));
  if (child_ < 0) return;
  // It has sent all that was asked for, or won't; its own way out can hang, too.
  const pid_t child = std::exchange(child_, -1);
  kill(child, SIGKILL);
  while (waitpid(child, &ending_, 0) < 0 && errno == EINTR) {
  }
}

void ReadingProcess::fail() {
  // The pipe has ended: the child has closed it, and ends now.
  if (child_ >= 0) {
    while (waitpid(child_, &ending_, 0) < 0 && errno == EINTR) {
    }
    child_ = -1;
  }
  end();
  const bool endless = WIFSIGNALED(ending_) && WTERMSIG(ending_) == SIGXCPU;
  throw InputError(
      fmt::format("{}: damaged: the library that reads it {}; copy it again, or write "
                  "it anew",
                  path_, endless ? "finds no end" : "crashes on it"));
}

std::uint64_t ReadingProcess::whole() {
  std::uint64_t value = 0;
  if (!MessageReader(descriptor_).whole(value)) fail();
  return value;
}

std::string ReadingProcess::text() {
  std::string value;
  if (!MessageReader(descriptor_).text(value)) fail();
  return value;
}

std::vector<std::string> ReadingProcess::texts() {
  std::vector<std::string> values;
  if (!MessageReader(descriptor_).texts(values)) fail();
  return values;
}

void ReadingProcess::numbers(double* values, std::size_t count) {
  if (!MessageReader(descriptor_).numbers(values, count)) fail();
}

void ReadingProcess::require_memory(std::size_t count) const {
  // Small arrays are frequent, and the look costs a system call or two.
  if (count > kSmall) require_memory_for_numbers(static_cast<long double>(count), path_);
}

AlignedArray ReadingProcess::numbers(std::size_t count) {
  require_memory(count);
  AlignedArray values(count);
  numbers(values.data(), count);
  return values;
}

int answer_reading(const ReadingTask& task, const std::vector<std::string>& arguments,
                   int descriptor) {
  MessageWriter answer(descriptor);
  answer.whole(kProtocol);
  const auto status = [&](ReadingStatus value) { answer.whole(static_cast<std::uint64_t>(value)); };
  try {
    set_limits(arguments.front());
    task.run(arguments, answer);
    return 0;
  } catch (const InputError& error) {
    status(ReadingStatus::kRefused);
    answer.text(error.what());
  } catch (const std::exception&) {
    status(ReadingStatus::kDamaged);
  }
  return 2;
}

}  // namespace graybox
