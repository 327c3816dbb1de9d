// Whether to stop: the one question of every loop that may last.
//
// Three things say so: the user (Ctrl-C: request_stop()), the time a command was given
// (limit_process()), and the time limit of the run that is under way on this thread (TimeLimit).
//
//   const graybox::TimeLimit limit(options.time_limit);  // of one run; ends with its scope
//   while (!done) {
//     if (graybox::stop_requested()) return best_so_far;
//     ...
//   }
//
// Work that has nothing to hand over throws Stopped instead, by stop_if_requested(); whoever has
// something catches it. Other threads do not see this thread's TimeLimit: code that starts them
// takes a StopClock first, and lets no exception leave the parallel region.
//
// A question costs a clock reading, some 30 ns: ask about once a microsecond or less often.
#pragma once

#include <cstdint>
#include <exception>

namespace graybox {

class Stopped : public std::exception {
 public:
  [[nodiscard]] const char* what() const noexcept override { return "stopped before the end"; }
};

// Safe in a signal handler. Never taken back, except by forget_stops().
void request_stop() noexcept;
[[nodiscard]] bool stop_was_asked_for() noexcept;  // by request_stop()

// All work of this process is to stop `seconds` from now.
void limit_process(double seconds) noexcept;

// As if neither of the two had been called: for tests, and for programs that go on after Ctrl-C.
void forget_stops() noexcept;

// The time at which this thread's work has to end, to be asked from any thread.
class StopClock {
 public:
  StopClock() noexcept;               // of the calling thread
  static StopClock never() noexcept;  // for work that has to be finished
  [[nodiscard]] bool stops() const noexcept;

 private:
  bool runs_ = true;
  std::int64_t end_;
};

// A limit of so many seconds from now for what this thread does while the object lives; a limit
// that is there already and ends sooner stays.
class TimeLimit {
 public:
  explicit TimeLimit(double seconds) noexcept;
  TimeLimit(const TimeLimit&) = delete;
  TimeLimit& operator=(const TimeLimit&) = delete;
  ~TimeLimit();

  // For time that is not the work's own (tracer.hpp).
  void extend(double seconds) noexcept;

 private:
  std::int64_t own_;
  std::int64_t former_;
};

[[nodiscard]] bool stop_requested() noexcept;
void stop_if_requested();  // throws Stopped

}  // namespace graybox
