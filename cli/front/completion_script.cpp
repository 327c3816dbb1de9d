#include "cli/front/completion_script.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cli/front/help_topics.hpp"

namespace graybox::cli {
namespace {

// Every command, parents first.
void collect(const CommandNode& node, std::vector<const CommandNode*>& all) {
  all.push_back(&node);
  for (const CommandNode& command : node.commands) collect(command, all);
}

std::vector<const CommandNode*> all_commands(const CommandNode& root) {
  std::vector<const CommandNode*> all;
  collect(root, all);
  return all;
}

std::string joined(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, " "));
}

// Within single quotes of a shell.
std::string quoted(const std::string& text) {
  std::string safe;
  for (const char c : text) safe += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return fmt::format("'{}'", safe);
}

std::string names_of(const std::vector<CommandNode>& commands) {
  std::vector<std::string> names;
  for (const CommandNode& command : commands) names.push_back(command.name);
  return joined(names);
}

std::string names_of(const std::vector<OptionNode>& options) {
  std::vector<std::string> names;
  for (const OptionNode& option : options) {
    names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return joined(names);
}

// The words of the one positional that takes words: `completion` has it.
std::string positional_words(const CommandNode& command) {
  std::vector<std::string> words;
  for (const OptionNode& each : command.positionals) {
    words.insert(words.end(), each.values.begin(), each.values.end());
  }
  return joined(words);
}

// What every shell's case statements share. `{0}` stands for the name of the path's variable.
std::string path_cases(const std::vector<const CommandNode*>& commands) {
  std::vector<std::string> paths;
  for (const CommandNode* command : commands) {
    if (!command->path.empty()) paths.push_back(fmt::format("\"{}\"", command->path));
  }
  return fmt::format("{}", fmt::join(paths, "|"));
}

// Sets `subcommands`, `switches` and `values` by the path.
std::string command_cases(const std::vector<const CommandNode*>& commands) {
  std::string text = "  case \"$place\" in\n";
  for (const CommandNode* command : commands) {
    text += fmt::format("    \"{}\") subcommands={} switches={} values={} ;;\n", command->path,
                        quoted(names_of(command->commands)), quoted(names_of(command->options)),
                        quoted(positional_words(*command)));
  }
  return text + "  esac\n";
}

// Sets `takes` and `values` by the path and the option before the cursor.
std::string option_cases(const std::vector<const CommandNode*>& commands) {
  std::string text = "  case \"$place $before\" in\n";
  for (const CommandNode* command : commands) {
    for (const OptionNode& option : command->options) {
      if (option.takes == OptionValue::kNone) continue;
      std::vector<std::string> patterns;
      for (const std::string& name : option.names) {
        patterns.push_back(fmt::format("\"{} {}\"", command->path, name));
      }
      const char* takes = option.takes == OptionValue::kWords  ? "words"
                          : option.takes == OptionValue::kFile ? "file"
                                                               : "number";
      text += fmt::format("    {}) takes={}", fmt::join(patterns, "|"), takes);
      if (!option.values.empty()) text += fmt::format(" values={}", quoted(joined(option.values)));
      text += " ;;\n";
    }
  }
  return text + "  esac\n";
}

// The words of `help` name a command, so that they are followed as the words of a line are.
constexpr const char* kBash = R"(# bash completion of graybox, made by: graybox completion bash
_graybox() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}"
  local place='' subcommands='' switches='' values='' takes='' topics='' i
  if [[ $word == '=' ]]; then
    word=''
  elif [[ $before == '=' ]]; then
    before="${{COMP_WORDS[COMP_CWORD-2]}}"
  fi
  for ((i = 1; i < COMP_CWORD; ++i)); do
    [[ $place == '' && ${{COMP_WORDS[i]}} == help ]] && topics={topics} && continue
    case "$place ${{COMP_WORDS[i]}}" in
      {paths}) place+=" ${{COMP_WORDS[i]}}" ;;
    esac
  done
{commands}{options}  COMPREPLY=()
  [[ $place == '' ]] && subcommands+=" $topics"
  if [[ $takes == number ]]; then
    return
  elif [[ $takes == words ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$values" -- "$word")
  elif [[ $takes == '' && $word == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$switches" -- "$word")
  elif [[ $takes == '' && $subcommands$values != '' ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$subcommands $values" -- "$word")
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$word")
    compopt -o filenames 2> /dev/null
  fi
}}
complete -F _graybox graybox
)";

constexpr const char* kZsh = R"(#compdef graybox
# zsh completion of graybox, made by: graybox completion zsh
_graybox() {{
  local word="${{words[CURRENT]}}" before="${{words[CURRENT-1]}}"
  local place='' subcommands='' switches='' values='' takes='' topics='' i
  for ((i = 2; i < CURRENT; ++i)); do
    [[ $place == '' && ${{words[i]}} == help ]] && topics={topics} && continue
    case "$place ${{words[i]}}" in
      {paths}) place+=" ${{words[i]}}" ;;
    esac
  done
{commands}{options}  [[ $place == '' ]] && subcommands+=" $topics"
  if [[ $takes == number ]]; then
    return 1
  elif [[ $takes == words ]]; then
    compadd -- ${{=values}}
  elif [[ $takes == '' && $word == -* ]]; then
    compadd -- ${{=switches}}
  elif [[ $takes == '' && $subcommands$values != '' ]]; then
    compadd -- ${{=subcommands}} ${{=values}}
  else
    _files
  fi
}}
if [[ $funcstack[1] == _graybox ]]; then
  _graybox "$@"
else
  compdef _graybox graybox
fi
)";

constexpr const char* kFish = R"(# fish completion of graybox, made by: graybox completion fish
function __graybox_place
  set -l place ''
  for word in (commandline -opc)[2..-1]
    test "$place" = '' -a "$word" = help; and continue
    contains -- "$place $word" {paths}; and set place "$place $word"
  end
  test "$place" = "$argv[1]"
end
complete -c graybox -n '__graybox_place "" && contains help (commandline -opc)' -f -a {topics}
)";

std::string topic_names() {
  std::vector<std::string> names;
  for (const HelpTopic& topic : help_topics()) names.emplace_back(topic.name);
  return joined(names);
}

std::string fish_option(const CommandNode& command, const OptionNode& option) {
  std::string text = fmt::format("complete -c graybox -n '__graybox_place \"{}\"'", command.path);
  for (const std::string& name : option.names) {
    text += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
  }
  if (option.takes == OptionValue::kWords) {
    text += fmt::format(" -x -a {}", quoted(joined(option.values)));
  } else if (option.takes == OptionValue::kFile) {
    text += " -r -F";
  } else if (option.takes == OptionValue::kNumber) {
    text += " -x";
  }
  return text + fmt::format(" -d {}\n", quoted(option.description));
}

std::string fish_script(const std::vector<const CommandNode*>& commands) {
  std::vector<std::string> paths;
  for (const CommandNode* command : commands) {
    if (!command->path.empty()) paths.push_back(quoted(command->path));
  }
  std::string text =
      fmt::format(fmt::runtime(kFish), fmt::arg("paths", fmt::format("{}", fmt::join(paths, " "))),
                  fmt::arg("topics", quoted(topic_names())));
  for (const CommandNode* command : commands) {
    const std::string here =
        fmt::format("complete -c graybox -n '__graybox_place \"{}\"'", command->path);
    for (const CommandNode& below : command->commands) {
      text += fmt::format("{} -f -a {} -d {}\n", here, below.name, quoted(below.description));
    }
    if (const std::string words = positional_words(*command); !words.empty()) {
      text += fmt::format("{} -f -a {}\n", here, quoted(words));
    }
    for (const OptionNode& option : command->options) text += fish_option(*command, option);
  }
  return text;
}

}  // namespace

std::string completion_script(const CommandNode& root, std::string_view shell) {
  const std::vector<const CommandNode*> commands = all_commands(root);
  if (shell == "fish") return fish_script(commands);
  return fmt::format(
      fmt::runtime(shell == "zsh" ? kZsh : kBash), fmt::arg("paths", path_cases(commands)),
      fmt::arg("commands", command_cases(commands)), fmt::arg("options", option_cases(commands)),
      fmt::arg("topics", quoted(topic_names())));
}

}  // namespace graybox::cli
