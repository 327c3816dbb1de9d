// How a command ends before its end: Ctrl-C (or SIGTERM) and --time-limit, both within a second or
// so. What has to look at a clock asks problems/base/stop.hpp; this sets it.
//
// A command that is not listening says "interrupted" and ends at the first signal, as any program
// does: so do all that hand nothing over. A second signal always ends the program.
#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace graybox::cli {

enum class OnStop {
  kHandsOver,     // the work asks stop.hpp, and the command then hands over what it has
  kLosesNothing,  // all that was done is on disk, or nothing would be handed over: where the work
                  // does not end in time by itself, the program ends
  kHandsOverInTime,  // of a time limit: what was found, if that takes no longer than half a second
};

// From now on the first signal is answered in words, and ends the program as it would without. A
// signal that is ignored, as of what runs in the background, stays so.
void answer_interrupts();

// From now on the first signal stops the work.
void catch_interrupts(OnStop on_stop = OnStop::kHandsOver);
[[nodiscard]] bool interrupted();

// --time-limit of a whole command, from here on: its work is to stop. One that hands nothing over
// ends half a second later where it has not ended by itself, with one line and exit code 1.
void limit_command(double seconds, OnStop on_stop);

// --time-limit, from here on, reading included. While the object lives nothing is there to hand
// over: half a second after the limit the program ends with one line and exit code 1. What follows
// asks stop.hpp. Infinity: no limit.
class ReadingLimit {
 public:
  // `what` is being read. Throws InputError for a limit that is not positive.
  ReadingLimit(double seconds, std::string what);
  ReadingLimit(const ReadingLimit&) = delete;
  ReadingLimit& operator=(const ReadingLimit&) = delete;
  ~ReadingLimit();

 private:
  void watch();

  double seconds_;
  std::string what_;
  std::mutex guard_;
  std::condition_variable end_;
  bool done_ = false;
  std::thread thread_;
};

}  // namespace graybox::cli
