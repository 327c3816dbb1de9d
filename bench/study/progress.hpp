// What a study says while it runs, on standard error. On a terminal, one line that is rewritten:
//
//   [ 37/152] robot Q = 2000, ipopt_dual (run 1)  2 min 10 s, about 6 min left
//
// In a pipe, nothing but one line a finished point. Both end with what finish() is told.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdio>
#include <string>

namespace graybox::bench {

class Progress {
 public:
  explicit Progress(std::FILE* stream = stderr);

  void start_run(const std::string& what, std::size_t done, std::size_t total, double seconds_left);
  // Shown in a pipe, and kept on a terminal only if `notable` (a run that ended badly).
  void finish_point(const std::string& line, bool notable);
  void say(const std::string& line);
  [[nodiscard]] double seconds() const;

 private:
  void clear_line();

  std::FILE* stream_;
  bool terminal_;
  std::chrono::steady_clock::time_point start_;
};

[[nodiscard]] std::string readable_duration(double seconds);  // "45 s", "2 min 10 s", "1 h 5 min"

}  // namespace graybox::bench
