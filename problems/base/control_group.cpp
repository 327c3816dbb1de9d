#include "problems/base/control_group.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <limits>

namespace graybox {
namespace {

constexpr std::size_t kNoLimit = std::numeric_limits<std::size_t>::max();

// What the two versions of control groups call the same.
struct Names {
  const char* limit;
  const char* used;
  std::array<std::string, 2> files;  // in memory.stat: bytes of files, which can be dropped
};

const Names kFirstVersion{
    "memory.limit_in_bytes", "memory.usage_in_bytes", {"total_inactive_file", "total_active_file"}};
const Names kSecondVersion{"memory.max", "memory.current", {"inactive_file", "active_file"}};

std::size_t room_of(const std::string& folder, const Names& names) {
  const auto limit = number_in_file(folder + "/" + names.limit);
  const auto used = number_in_file(folder + "/" + names.used);
  if (!limit || !used) return kNoLimit;
  std::size_t kept = *used;
  for (const std::string& name : names.files) {
    kept -= std::min(kept, number_in_file(folder + "/memory.stat", name).value_or(0));
  }
  return *limit - std::min(*limit, kept);
}

// In a container the group's path can be that of the host, and the folder itself the group.
std::size_t least_room(const std::string& mounted, std::string path, const Names& names) {
  std::size_t least = room_of(mounted, names);
  while (path.size() > 1) {
    least = std::min(least, room_of(mounted + path, names));
    path.resize(path.rfind('/'));
  }
  return least;
}

}  // namespace

std::optional<std::size_t> number_in_file(const std::string& file, const std::string& name) {
  std::ifstream stream(file);
  std::string word;
  if (!name.empty()) {
    while (stream >> word && word != name) {
    }
  }
  std::size_t value = 0;
  if (stream >> value) return value;
  return std::nullopt;
}

std::size_t control_group_room(const std::string& root, const std::string& membership) {
  std::size_t least = kNoLimit;
  std::ifstream lines(membership);
  for (std::string line; std::getline(lines, line);) {  // "4:memory:/path", "0::/path"
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos || line.size() <= second + 1) continue;
    const std::string kinds = line.substr(first, second - first) + ":";
    const std::string path = line.substr(second + 1);
    if (path.front() != '/') continue;
    if (kinds == "::") least = std::min(least, least_room(root, path, kSecondVersion));
    if (kinds == ":memory:") {
      least = std::min(least, least_room(root + "/memory", path, kFirstVersion));
    }
  }
  return least;
}

}  // namespace graybox
