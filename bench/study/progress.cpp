#include "bench/study/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>

namespace graybox::bench {

std::string readable_duration(double seconds) {
  const auto whole = static_cast<long>(std::lround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole % 3600 / 60);
}

Progress::Progress(std::FILE* stream)
    : stream_(stream),
      terminal_(isatty(fileno(stream)) == 1),
      start_(std::chrono::steady_clock::now()) {}

double Progress::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

void Progress::clear_line() {
  if (terminal_) fmt::print(stream_, "\r\033[K");
}

void Progress::start_run(const std::string& what, std::size_t done, std::size_t total,
                         double seconds_left) {
  if (!terminal_) return;
  clear_line();
  fmt::print(stream_, "[{:>4}/{}] {}  {}, about {} left", done, total, what,
             readable_duration(seconds()), readable_duration(seconds_left));
  std::fflush(stream_);
}

void Progress::finish_point(const std::string& line, bool notable) {
  if (!terminal_ || notable) say(line);
}

void Progress::say(const std::string& line) {
  clear_line();
  fmt::print(stream_, "{}\n", line);
  std::fflush(stream_);
}

}  // namespace graybox::bench
