#include "problems/base/available_memory.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <optional>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

// The first number after `name` in a file of words; the first number of all for an empty name.
std::optional<std::size_t> number_in(const char* file, const std::string& name) {
  std::ifstream stream(file);
  std::string word;
  if (!name.empty()) {
    while (stream >> word && word != name) {
    }
  }
  std::size_t value = 0;
  if (stream >> value) return value;
  return std::nullopt;  // no such file, or "max"
}

std::size_t difference(std::size_t limit, std::size_t used) {
  return limit > used ? limit - used : 0;
}

}  // namespace

std::size_t used_address_space() {
  return number_in("/proc/self/status", "VmSize:").value_or(0) * 1024;
}

std::size_t available_memory() {
  std::size_t least = std::numeric_limits<std::size_t>::max();
  if (const auto kilobytes = number_in("/proc/meminfo", "MemAvailable:")) {
    least = std::min(least, *kilobytes * 1024);
  }
  const auto group_limit = number_in("/sys/fs/cgroup/memory.max", "");
  const auto group_used = number_in("/sys/fs/cgroup/memory.current", "");
  if (group_limit && group_used) least = std::min(least, difference(*group_limit, *group_used));
  rlimit space{};
  if (getrlimit(RLIMIT_AS, &space) == 0 && space.rlim_cur != RLIM_INFINITY) {
    least = std::min(least, difference(space.rlim_cur, used_address_space()));
  }
  return least;
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
                  "machine with more",
                  source, bytes, static_cast<double>(available)));
}

}  // namespace graybox
