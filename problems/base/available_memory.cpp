#include "problems/base/available_memory.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <limits>

#include "problems/base/control_group.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr std::size_t kNoLimit = std::numeric_limits<std::size_t>::max();

std::size_t difference(std::size_t limit, std::size_t used) {
  return limit > used ? limit - used : 0;
}

std::size_t limit_of(decltype(RLIMIT_AS) resource) {
  rlimit bounds{};
  if (getrlimit(resource, &bounds) != 0 || bounds.rlim_cur == RLIM_INFINITY) return kNoLimit;
  return bounds.rlim_cur;
}

// What is left of a limit of this process: /proc/self/status has its use under `name`, in kB.
std::size_t left_of(decltype(RLIMIT_AS) resource, const char* name) {
  const std::size_t limit = limit_of(resource);
  if (limit == kNoLimit) return kNoLimit;
  return difference(limit, number_in_file("/proc/self/status", name).value_or(0) * 1024);
}

}  // namespace

std::size_t used_address_space() {
  return number_in_file("/proc/self/status", "VmSize:").value_or(0) * 1024;
}

std::size_t available_memory() {
  std::size_t least = control_group_room();
  if (const auto kilobytes = number_in_file("/proc/meminfo", "MemAvailable:")) {
    least = std::min(least, *kilobytes * 1024);
  }
  return std::min(least, room_in_process_limits());
}

std::size_t process_limit() { return std::min(limit_of(RLIMIT_AS), limit_of(RLIMIT_DATA)); }

std::size_t room_in_process_limits() {
  return std::min(left_of(RLIMIT_AS, "VmSize:"), left_of(RLIMIT_DATA, "VmData:"));
}

NotEnoughMemory::NotEnoughMemory(std::size_t bytes, std::size_t available)
    : line_(fmt::format("{:.2g} GB of memory are needed in one piece, {:.2g} GB are there",
                        static_cast<double>(bytes) / 1e9, static_cast<double>(available) / 1e9)) {}

std::string describe_shortage(const std::bad_alloc& error) {
  constexpr const char* kRemedy =
      "use fewer candidates, samples or threads, or a machine (or a limit) with more";
  if (const auto* known = dynamic_cast<const NotEnoughMemory*>(&error)) {
    return fmt::format("not enough memory: {}; {}", known->what(), kRemedy);
  }
  return fmt::format("not enough memory for this problem: {} MB are there; {}",
                     available_memory() / 1'000'000, kRemedy);
}

void require_memory(std::size_t bytes, const std::string& what, const std::string& fix) {
  const std::size_t available = available_memory();
  if (bytes <= available) return;
  throw InputError(fmt::format("{} takes {:.2f} GB of memory, {:.2f} GB are available; {}", what,
                               static_cast<double>(bytes) / 1e9,
                               static_cast<double>(available) / 1e9, fix));
}

void require_memory_for_numbers(long double count, const std::string& source) {
  const long double bytes = count * sizeof(double);
  const std::size_t available = available_memory();
  if (bytes <= static_cast<long double>(available)) return;
  throw InputError(
      fmt::format("{}: needs {:.2g} bytes of memory, {:.2g} are there; use a part of it, or a "
                  "machine (or a limit) with more",
                  source, bytes, static_cast<double>(available)));
}

}  // namespace graybox
