#include "cli/process/interrupt.hpp"

#include <fmt/format.h>
#include <sys/time.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "cli/process/exit_code.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"

namespace graybox::cli {
namespace {

constexpr int kPatienceMicroseconds = 700'000;
constexpr double kReadingPatience = 0.5;  // s
constexpr double kLongestWait = 1e8;      // s: steady_clock counts nanoseconds

volatile std::sig_atomic_t at_terminal = 0;  // standard error is one

// On a terminal in place of the line of progress.
void say(std::string_view line) {
  constexpr std::string_view kClear = "\r\033[K";
  if (at_terminal != 0) {
    [[maybe_unused]] const auto cleared = write(STDERR_FILENO, kClear.data(), kClear.size());
  }
  [[maybe_unused]] const auto written = write(STDERR_FILENO, line.data(), line.size());
}

extern "C" void on_interrupt(int /*signal*/) {
  request_stop();
  const itimerval patience{.it_interval = {0, 0}, .it_value = {0, kPatienceMicroseconds}};
  setitimer(ITIMER_REAL, &patience, nullptr);
}

// Where the work has not ended by then.
extern "C" void on_patience_end_hands_over(int /*signal*/) {
  say("graybox: stopping; once more to end at once\n");
}

extern "C" void on_patience_end_loses_nothing(int /*signal*/) {
  say("graybox: interrupted\n");
  std::_Exit(kShort);
}

// The handler is gone by now, so that the signal ends the program once this returns.
extern "C" void on_interrupt_unheard(int signal) {
  say("graybox: interrupted\n");
  std::raise(signal);
}

void handle(int signal, void (*handler)(int), int flags) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = flags;
  sigemptyset(&action.sa_mask);
  sigaction(signal, &action, nullptr);
}

}  // namespace

void answer_interrupts() {
  at_terminal = isatty(STDERR_FILENO);
  for (const int signal : {SIGINT, SIGTERM}) {
    struct sigaction present {};
    sigaction(signal, nullptr, &present);
    if (present.sa_handler != SIG_DFL) continue;
    handle(signal, &on_interrupt_unheard, static_cast<int>(SA_RESETHAND));
  }
}

void catch_interrupts(OnStop on_stop) {
  handle(
      SIGALRM,
      on_stop == OnStop::kHandsOver ? &on_patience_end_hands_over : &on_patience_end_loses_nothing,
      SA_RESTART);
  handle(SIGINT, &on_interrupt, static_cast<int>(SA_RESETHAND));
  handle(SIGTERM, &on_interrupt, static_cast<int>(SA_RESETHAND));
}

bool interrupted() { return stop_was_asked_for(); }

void limit_command(double seconds, OnStop on_stop) {
  limit_process(seconds);
  if (on_stop == OnStop::kHandsOver) return;
  std::thread([seconds] {
    std::this_thread::sleep_for(
        std::chrono::duration<double>(std::fmin(seconds, kLongestWait) + kReadingPatience));
    say(fmt::format("graybox: the time limit of {} s passed before the end\n", seconds));
    std::_Exit(kShort);
  }).detach();
}

ReadingLimit::ReadingLimit(double seconds, std::string what)
    : seconds_(seconds), what_(std::move(what)) {
  if (!(seconds > 0.0)) {
    throw InputError(fmt::format("time limit {} s must be positive", seconds));
  }
  if (!std::isfinite(seconds)) return;
  limit_process(seconds);
  thread_ = std::thread([this] { watch(); });
}

void ReadingLimit::watch() {
  const std::chrono::duration<double> wait(std::fmin(seconds_ + kReadingPatience, kLongestWait));
  std::unique_lock lock(guard_);
  if (end_.wait_for(lock, wait, [&] { return done_; })) return;
  say(fmt::format("graybox: the time limit of {} s passed while {} was read; nothing was done\n",
                  seconds_, what_));
  std::_Exit(kShort);
}

ReadingLimit::~ReadingLimit() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(guard_);
    done_ = true;
  }
  end_.notify_all();
  thread_.join();
}

}  // namespace graybox::cli
