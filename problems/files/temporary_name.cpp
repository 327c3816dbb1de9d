#include "problems/files/temporary_name.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <mutex>
#include <optional>
#include <set>
#include <string_view>
#include <tuple>
#include <vector>

namespace graybox {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMark = ".graybox-";
constexpr std::string_view kEnding = ".tmp";
constexpr std::size_t kDrawn = 6;          // characters that mkstemps draws
constexpr std::size_t kLongestName = 180;  // of 255 bytes that file systems allow

// The process that made the file; nothing for a name of another form.
std::optional<pid_t> maker_of(std::string_view name) {
  const std::size_t mark = name.rfind(kMark);
  if (!name.starts_with('.') || !name.ends_with(kEnding) || mark == std::string_view::npos) {
    return std::nullopt;
  }
  const std::string_view rest =
      name.substr(mark + kMark.size(), name.size() - mark - kMark.size() - kEnding.size());
  pid_t process = 0;
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), process);
  const auto drawn = static_cast<std::size_t>(rest.data() + rest.size() - end);
  if (error != std::errc() || drawn != kDrawn + 1 || *end != '-' || process <= 0) {
    return std::nullopt;
  }
  return process;
}

const fs::file_time_type kStart = fs::file_time_type::clock::now();  // of this process

// In containers the next run often has the number of the last one: what bears our own number and
// was written before we started is not ours.
bool is_left(const fs::path& file, pid_t maker) {
  if (maker != getpid()) return kill(maker, 0) != 0 && errno == ESRCH;
  std::error_code error;
  const fs::file_time_type written = fs::last_write_time(file, error);
  return !error && written < kStart;
}

// True the first time that this process asks for the folder.
bool first_visit(const fs::path& folder) {
  static std::mutex mutex;
  static std::set<std::tuple<std::string, dev_t, ino_t>> visited;
  struct stat status {};
  if (stat(folder.c_str(), &status) != 0) return false;
  const std::scoped_lock lock(mutex);
  return visited.emplace(folder.string(), status.st_dev, status.st_ino).second;
}

}  // namespace

std::string temporary_pattern(const fs::path& target) {
  const std::string name = target.filename().string().substr(0, kLongestName);
  return (target.parent_path() / fmt::format(".{}{}{}-XXXXXX{}", name, kMark, getpid(), kEnding))
      .string();
}

bool is_temporary_name(const std::string& name) { return maker_of(name).has_value(); }

void remove_leftovers(const fs::path& folder) {
  const fs::path here = folder.empty() ? "." : folder;
  if (!first_visit(here)) return;
  std::error_code error;
  std::vector<fs::path> leftovers;
  for (fs::directory_iterator entry(here, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::optional<pid_t> maker = maker_of(entry->path().filename().string());
    if (maker && is_left(entry->path(), *maker)) leftovers.push_back(entry->path());
  }
  for (const fs::path& file : leftovers) fs::remove(file, error);
}

}  // namespace graybox
