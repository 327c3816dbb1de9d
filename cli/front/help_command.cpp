// `graybox help [command ...]`: what --help prints, the way that git and others have it, too; and
// `graybox help TOPIC`.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>
#include <string>
#include <vector>

#include "cli/commands/commands.hpp"
#include "cli/front/diagnosis_commands.hpp"
#include "cli/front/help_topics.hpp"
#include "problems/base/error.hpp"

namespace graybox::cli {
namespace {

const CLI::App& find_command(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* level = &app;
  for (const std::string& word : words) {
    const auto found = level->get_subcommands(
        [&](const CLI::App* command) { return command->get_name() == word; });
    if (found.empty()) {
      const std::string reason = reason_for_absence(fmt::format("{}", fmt::join(words, " ")));
      if (!reason.empty()) throw InputError(reason);
      throw InputError(
          fmt::format("help: no command '{}'; see graybox help", fmt::join(words, " ")));
    }
    level = found.front();
  }
  return *level;
}

}  // namespace

void add_help_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("help", "Print the help of a command");
  auto words = std::make_shared<std::vector<std::string>>();
  command->add_option("command", *words,
                      "such as 'solve' or 'design robust', or a topic (default: all)");
  std::string footer = "Topics:\n";
  for (const HelpTopic& topic : help_topics()) {
    footer += fmt::format("  {:<16}{}\n", topic.name, topic.title);
  }
  command->footer(footer +
                  "Examples:\n"
                  "  graybox help\n"
                  "  graybox help design robust\n"
                  "  graybox help constraints");
  command->callback([&app, words, &invocation] {
    invocation.exit_code = kDone;
    if (words->size() == 1) {
      if (const HelpTopic* topic = topic_named(words->front()); topic != nullptr) {
        fmt::print("{}", topic_text(app, *topic));
        return;
      }
    }
    const CLI::App& asked = find_command(app, *words);
    const std::string before =
        fmt::format("graybox{}{}", words->empty() ? "" : " ", fmt::join(*words, " "));
    // Not asked.help(): CLI11 would print the help of the command that is being run.
    fmt::print("{}", asked.get_formatter()->make_help(&asked, before, CLI::AppFormatMode::Normal));
  });
}

}  // namespace graybox::cli
