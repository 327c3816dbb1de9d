#include "bench/study/environment.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <system_error>
#include <vector>

#include "problems/base/program_version.hpp"
#include "problems/base/sha256.hpp"
#include "problems/kernels/kernels.hpp"

namespace graybox::bench {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

std::string first_line(const fs::path& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  return line;
}

// The value of the first line "key<separator>value" of a file such as /proc/cpuinfo.
std::string field(const fs::path& file, std::string_view key, char separator) {
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t at = line.find(separator);
    if (at == std::string::npos) continue;
    const std::size_t from = line.find_first_not_of(" \t\"", at + 1);
    if (from == std::string::npos) continue;
    return line.substr(from, line.find_last_not_of("\" \t") + 1 - from);
  }
  return {};
}

std::string command_output(const char* command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command, "r"), &pclose);
  if (!pipe) return {};
  std::array<char, 256> buffer{};
  std::string text;
  while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe.get()) != nullptr) {
    text += buffer.data();
  }
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

json caches() {
  json list = json::array();
  const fs::path folder = "/sys/devices/system/cpu/cpu0/cache";
  std::error_code error;
  std::vector<fs::path> entries;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().filename().string().starts_with("index")) entries.push_back(entry.path());
  }
  std::ranges::sort(entries);
  for (const fs::path& entry : entries) {
    const std::string type = first_line(entry / "type");
    if (type == "Instruction") continue;
    list.push_back(fmt::format("L{} {}", first_line(entry / "level"), first_line(entry / "size")));
  }
  return list;
}

}  // namespace

std::string current_commit() {
  const std::string hash = command_output("git rev-parse HEAD 2>/dev/null");
  if (hash.empty()) return {};
  const std::string changes =
      command_output("git status --porcelain --untracked-files=no -- ':!results' 2>/dev/null");
  return changes.empty() ? hash : hash + "+";
}

double load_average() {
  double load = 0.0;
  return getloadavg(&load, 1) == 1 ? load : 0.0;
}

std::string utc_now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

std::string program_hash() {
  std::ifstream stream("/proc/self/exe", std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  // A commit that changes no code makes no other program: its name in it does not count.
  const std::string& commit = program_commit();
  for (std::size_t at = bytes.find(commit); at != std::string::npos; at = bytes.find(commit, at)) {
    const std::size_t end = std::min(at + kCommitField, bytes.size());
    std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(at),
              bytes.begin() + static_cast<std::ptrdiff_t>(end), '\0');
  }
  Sha256 hash;
  hash.update(bytes);
  return hash.hexadecimal().substr(0, 12);
}

std::string files_hash(const std::string& command) {
  constexpr std::string_view kSeparators = " \t\n'\"()";
  Sha256 hash;
  bool any = false;
  for (std::size_t at = 0;
       (at = command.find_first_not_of(kSeparators, at)) != std::string::npos;) {
    const std::size_t end = std::min(command.find_first_of(kSeparators, at), command.size());
    const fs::path word = command.substr(at, end - at);
    at = end;
    std::error_code error;
    if (!fs::is_regular_file(word, error)) continue;
    std::ifstream stream(word, std::ios::binary);
    hash.update(std::string(std::istreambuf_iterator<char>(stream), {}));
    any = true;
  }
  return any ? hash.hexadecimal().substr(0, 12) : std::string();
}

json describe_environment() {
  utsname system{};
  uname(&system);
  return {{"kind", "environment"},
          {"date", utc_now()},
          {"commit", current_commit()},
          {"binary", program_hash()},
          {"processor", field("/proc/cpuinfo", "model name", ':')},
          {"cores", sysconf(_SC_NPROCESSORS_ONLN)},
          {"caches", caches()},
          {"memory", field("/proc/meminfo", "MemTotal", ':')},
          {"system", field("/etc/os-release", "PRETTY_NAME", '=')},
          {"kernel", fmt::format("{} {}", system.sysname, system.release)},
          {"compiler", GRAYBOX_COMPILER},
          {"flags", GRAYBOX_COMPILE_FLAGS},
          {"libraries", GRAYBOX_LIBRARY_VERSIONS},
          {"kernels", kernels().name},
          {"load", load_average()}};
}

json describe_environment(const std::vector<AbsentSolver>& absent) {
  json environment = describe_environment();
  json list = json::array();
  for (const AbsentSolver& each : absent) {
    list.push_back({{"name", each.name}, {"needs", each.needs}});
  }
  if (!list.empty()) environment["absent"] = std::move(list);
  return environment;
}

std::vector<AbsentSolver> absent_solvers(const json& environment) {
  std::vector<AbsentSolver> absent;
  const auto list = environment.find("absent");
  if (list == environment.end() || !list->is_array()) return absent;
  for (const json& each : *list) {
    if (!each.is_object()) continue;
    const auto name = each.find("name"), needs = each.find("needs");
    if (name == each.end() || !name->is_string()) continue;
    absent.push_back({*name, needs != each.end() && needs->is_string() ? needs->get<std::string>()
                                                                       : std::string()});
  }
  return absent;
}

std::string environment_words(const json& environment, const std::string& key) {
  const auto value = environment.find(key);
  if (value == environment.end()) return "unknown";
  if (value->is_array())
    return fmt::format("{}", fmt::join(value->get<std::vector<std::string>>(), ", "));
  if (!value->is_string()) return value->dump();
  const std::string text = *value;
  double kibibytes = 0.0;
  if (!text.ends_with(" kB") || std::sscanf(text.c_str(), "%lf", &kibibytes) != 1) return text;
  return fmt::format("{:.1f} GB", 1024e-9 * kibibytes);
}

}  // namespace graybox::bench
