// The commands as a tree of plain data, from what CLI11 knows of them: commands, options, and what
// an option takes.
//
//   const CommandNode root = command_tree(app);
//   root.commands[2].name                           // "solve"
//   root.commands[2].options[3].values              // the back-ends
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace graybox::cli {

enum class OptionValue : std::int8_t {
  kNone,    // a flag
  kWords,   // one of `values`
  kNumber,  // also other things that can't be listed, as a column's name
  kFile,
};

struct OptionNode {
  std::vector<std::string> names;  // "-o", "--output"; none of a positional
  std::string description;
  OptionValue takes = OptionValue::kNone;
  std::vector<std::string> values;
};

struct CommandNode {
  std::string name, description;
  std::string path;  // " design robust"; empty at the root
  std::vector<OptionNode> options;
  std::vector<OptionNode> positionals;
  std::vector<CommandNode> commands;
};

[[nodiscard]] OptionNode option_node(const CLI::Option& option);

// Without what is not for users (commands of no group).
[[nodiscard]] CommandNode command_tree(const CLI::App& app);

}  // namespace graybox::cli
