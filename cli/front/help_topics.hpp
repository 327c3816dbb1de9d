// Topics of `graybox help`: options that several commands share. The help of a command names them
// in a line; the topic prints them in full.
#pragma once

#include <CLI/CLI.hpp>
#include <span>
#include <string>

namespace graybox::cli {

struct HelpTopic {
  const char* name;   // "constraints"
  const char* group;  // of its options, option_groups.hpp
  const char* title;
  const char* footer;
};

[[nodiscard]] std::span<const HelpTopic> help_topics();

// The topic of a group of options; nullptr: it has none.
[[nodiscard]] const HelpTopic* topic_of_group(const std::string& group);
// The topic of that name; nullptr: there is none.
[[nodiscard]] const HelpTopic* topic_named(const std::string& name);

// The page that `graybox help NAME` prints: the options of every command below `app`.
[[nodiscard]] std::string topic_text(const CLI::App& app, const HelpTopic& topic);

}  // namespace graybox::cli
