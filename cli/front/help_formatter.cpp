#include "cli/front/help_formatter.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "cli/front/help_text.hpp"
#include "cli/front/help_topics.hpp"

namespace graybox::cli {
namespace {

constexpr std::size_t kOptionColumn = 30, kCommandColumn = 18;  // where descriptions begin
constexpr const char* kCommands = "Subcommands";                // CLI11's group of all of them

// "{c,csv,urdf}" of "TEXT:{c,csv,urdf}", or nothing.
std::string words_of(const std::string& type) {
  const std::size_t from = type.find('{'), to = type.find('}');
  return from == std::string::npos || to == std::string::npos ? std::string()
                                                              : type.substr(from, to + 1 - from);
}

// The place of an option in its group. What every command has is at the end, and help the last:
// whoever reads this knows it.
int rank(const CLI::App& app, const CLI::Option* option) {
  constexpr std::string_view kEverywhere[] = {"--time-limit", "--seed", "--threads", "--json"};
  if (option == app.get_help_ptr()) return 3;
  const std::string name = option->get_name();
  if (std::ranges::find(kEverywhere, name) != std::end(kEverywhere)) return 2;
  return option->get_required() || name == "--output" ? 0 : 1;
}

// The help of those that are shared: their names, and where they are told in full.
std::string pointer_text(const HelpTopic& topic, const std::vector<const CLI::Option*>& options,
                         std::size_t columns) {
  constexpr std::size_t kIndent = 4;
  std::vector<std::string> names;
  for (const CLI::Option* option : options) names.push_back(option->get_name());
  const std::string indent(kIndent, ' ');
  return fmt::format("\n{} (in full: graybox help {}):\n{}{}", topic.group, topic.name, indent,
                     folded(fmt::format("{}", fmt::join(names, ", ")), columns, kIndent));
}

}  // namespace

std::string HelpFormatter::make_help(const CLI::App* app, std::string name,
                                     CLI::AppFormatMode /*mode*/) const {
  constexpr std::size_t kBehindUsage = 7;
  return folded(make_description(app), columns_) +
         folded(make_usage(app, std::move(name)), columns_, kBehindUsage) + make_positionals(app) +
         option_groups(*app) + make_subcommands(app, CLI::AppFormatMode::Normal) + '\n' +
         folded_paragraphs(app->get_footer(), columns_);
}

std::string HelpFormatter::option_groups(const CLI::App& app) const {
  std::string in_full, pointers;
  for (const std::string& group : app.get_groups()) {
    if (group.empty()) continue;
    std::vector<const CLI::Option*> options = app.get_options([&](const CLI::Option* option) {
      return option->get_group() == group && option->nonpositional();
    });
    if (options.empty()) continue;
    if (const HelpTopic* topic = topic_of_group(group); topic != nullptr) {
      pointers += pointer_text(*topic, options, columns_);
      continue;
    }
    std::ranges::stable_sort(options, {},
                             [&](const CLI::Option* option) { return rank(app, option); });
    in_full += make_group(group, false, options);
  }
  return in_full + pointers;
}

std::string HelpFormatter::make_subcommands(const CLI::App* app,
                                            CLI::AppFormatMode /*mode*/) const {
  std::vector<std::string> groups;
  const auto commands = app->get_subcommands([](const CLI::App*) { return true; });
  for (const CLI::App* command : commands) {
    const std::string group = command->get_group();
    if (group.empty() || std::ranges::find(groups, group) != groups.end()) continue;
    groups.push_back(group);
  }
  if (groups.empty()) return {};
  std::string text = fmt::format("\n{}:\n", kCommands);
  for (const std::string& group : groups) {
    if (group != kCommands) text += fmt::format(" {}:\n", group);
    for (const CLI::App* command : commands) {
      if (command->get_group() != group) continue;
      text +=
          in_two_columns(command->get_name(), command->get_description(), kCommandColumn, columns_);
    }
  }
  return text;
}

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
  return in_two_columns(make_option_name(option, is_positional) + make_option_opts(option),
                        make_option_desc(option), kOptionColumn, columns_);
}

// Without what a flag sets: "--no-families{false}".
std::string HelpFormatter::make_option_name(const CLI::Option* option, bool is_positional) const {
  const std::string name = CLI::Formatter::make_option_name(option, is_positional);
  return name.substr(0, name.find('{'));
}

// "FLOAT=0.05" of "FLOAT:FLOAT in [0.0005 - 0.5]"; words where there is room for them.
std::string HelpFormatter::make_option_opts(const CLI::Option* option) const {
  if (option->get_type_size() == 0) return {};  // a flag
  std::string rest;
  if (!option->get_default_str().empty()) rest += "=" + option->get_default_str();
  if (option->get_expected_max() == CLI::detail::expected_max_vector_size) rest += " ...";
  if (option->get_required()) rest += " REQUIRED";
  const std::string type = option->get_type_name(), words = words_of(type);
  const std::string name = make_option_name(option, option->get_positional());
  constexpr std::size_t kBetween = 4;  // two spaces before the name, one behind it, one at the end
  const bool has_room = name.size() + words.size() + rest.size() + kBetween <= kOptionColumn;
  return " " + (words.empty() || !has_room ? type.substr(0, type.find(':')) : words) + rest;
}

std::string HelpFormatter::make_option_desc(const CLI::Option* option) const {
  std::set<std::string> others;
  for (const CLI::Option* other : option->get_excludes()) others.insert(other->get_name());
  if (others.empty()) return option->get_description();
  return fmt::format("{} (not with {})", option->get_description(), fmt::join(others, ", "));
}

}  // namespace graybox::cli
