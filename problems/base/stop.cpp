#include "problems/base/stop.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>

namespace graybox {
namespace {

constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

std::atomic<bool> asked_for{false};
std::atomic<std::int64_t> process_end{kNever};
thread_local std::int64_t thread_end = kNever;

static_assert(std::atomic<bool>::is_always_lock_free, "request_stop() runs in signal handlers");

std::int64_t now() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

std::int64_t after(double seconds) noexcept {
  constexpr double kLongest = 1e9;  // s, thirty years
  if (!(seconds < kLongest)) return kNever;
  return now() + static_cast<std::int64_t>(std::fmax(seconds, 0.0) * 1e9);
}

bool stops_at(std::int64_t end) noexcept {
  if (asked_for.load(std::memory_order_relaxed)) return true;
  const std::int64_t first = std::min(end, process_end.load(std::memory_order_relaxed));
  return first != kNever && now() >= first;
}

}  // namespace

void request_stop() noexcept { asked_for.store(true, std::memory_order_relaxed); }
bool stop_was_asked_for() noexcept { return asked_for.load(std::memory_order_relaxed); }
void limit_process(double seconds) noexcept { process_end.store(after(seconds)); }

void forget_stops() noexcept {
  asked_for.store(false);
  process_end.store(kNever);
}

StopClock::StopClock() noexcept : end_(thread_end) {}
StopClock StopClock::never() noexcept {
  StopClock clock;
  clock.runs_ = false;
  return clock;
}
bool StopClock::stops() const noexcept { return runs_ && stops_at(end_); }

TimeLimit::TimeLimit(double seconds) noexcept : own_(after(seconds)), former_(thread_end) {
  thread_end = std::min(own_, former_);
}
TimeLimit::~TimeLimit() { thread_end = former_; }

void TimeLimit::extend(double seconds) noexcept {
  if (own_ == kNever) return;
  own_ += static_cast<std::int64_t>(seconds * 1e9);
  thread_end = std::min(own_, former_);
}

bool stop_requested() noexcept { return stops_at(thread_end); }

void stop_if_requested() {
  if (stop_requested()) throw Stopped();
}

}  // namespace graybox
