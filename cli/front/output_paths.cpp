#include "cli/front/output_paths.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "cli/front/command_tree.hpp"
#include "problems/base/error.hpp"

namespace graybox::cli {
namespace {

namespace fs = std::filesystem;

struct NamedPath {
  std::string option;  // "--report"
  fs::path path;
};

struct PathsOfCommand {
  std::vector<NamedPath> written, read;
};

bool is_written(const OptionNode& option) {
  constexpr std::string_view kNames[] = {"--output", "--report", "--checkpoint", "--history",
                                         "--table",  "--write",  "--trace"};
  const std::string_view name = option.names.empty() ? std::string_view() : option.names.back();
  return std::ranges::find(kNames, name) != std::end(kNames) ||
         option.description.starts_with("write");
}

// What is written for a value: the files that begin with it where the description calls it X.
std::vector<std::string> written_for(const OptionNode& option, const std::string& value) {
  std::vector<std::string> paths;
  const std::string& text = option.description;
  for (std::size_t at = text.find("X_"); at != std::string::npos; at = text.find("X_", at + 1)) {
    const std::size_t end = text.find_first_of(", :\n", at);
    paths.push_back(value + text.substr(at + 1, end - at - 1));
  }
  if (paths.empty()) paths.push_back(value);
  return paths;
}

void add_paths(const CLI::App& command, PathsOfCommand& paths) {
  for (const CLI::Option* option : command.get_options()) {
    const OptionNode node = option_node(*option);
    if (node.takes != OptionValue::kFile) continue;
    const std::string name = node.names.empty() ? option->get_name() : node.names.back();
    for (const std::string& value : option->results()) {
      if (!is_written(node)) {
        paths.read.push_back({.option = name, .path = value});
        continue;
      }
      for (const std::string& each : written_for(node, value)) {
        paths.written.push_back({.option = name, .path = each});
      }
    }
  }
  for (const CLI::App* chosen : command.get_subcommands()) add_paths(*chosen, paths);
}

// Where a file is that need not exist: links followed, folders resolved.
fs::path place_of(fs::path path) {
  constexpr int kMostLinks = 40;
  std::error_code error;
  for (int links = 0; links < kMostLinks; ++links) {
    const fs::path next = fs::read_symlink(path, error);
    if (error) break;
    path = path.parent_path() / next;
  }
  const fs::path place = fs::weakly_canonical(fs::absolute(path, error), error);
  return error ? path : place;
}

bool is_same_place(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::is_other(a, error) || fs::is_character_file(a, error) || fs::is_fifo(a, error)) {
    return false;
  }
  return fs::equivalent(a, b, error) || place_of(a) == place_of(b);
}

void require_distinct(const PathsOfCommand& paths) {
  const std::vector<NamedPath>& written = paths.written;
  for (std::size_t k = 0; k < written.size(); ++k) {
    for (std::size_t j = 0; j < k; ++j) {
      if (!is_same_place(written[j].path, written[k].path)) continue;
      throw InputError(fmt::format("{}: {} and {} both write to it; give each a place of its own",
                                   written[k].path.string(), written[j].option, written[k].option));
    }
    for (const NamedPath& input : paths.read) {
      std::error_code error;
      if (!fs::is_regular_file(input.path, error)) continue;
      if (!fs::equivalent(input.path, written[k].path, error)) continue;
      throw InputError(
          fmt::format("{}: is an input of this command, too ({}); let {} write to another file",
                      written[k].path.string(), input.option, written[k].option));
    }
  }
}

}  // namespace

void require_distinct_outputs(const CLI::App& app) {
  PathsOfCommand paths;
  add_paths(app, paths);
  require_distinct(paths);
}

}  // namespace graybox::cli
