// `graybox completion bash|zsh|fish`: a script that completes command lines, printed.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "cli/commands/commands.hpp"
#include "cli/front/completion_script.hpp"

namespace graybox::cli {

void add_completion_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("completion", "Completion of command lines for your shell");
  auto shell = std::make_shared<std::string>();
  command->add_option("shell", *shell, "bash, zsh or fish")
      ->check(CLI::IsMember({"bash", "zsh", "fish"}))
      ->required();
  command->footer(
      "Examples, once for each user:\n"
      "  graybox completion bash > ~/.local/share/bash-completion/completions/graybox\n"
      "  graybox completion zsh > \"${fpath[1]}/_graybox\"\n"
      "  graybox completion fish > ~/.config/fish/completions/graybox.fish");
  command->callback([&app, shell, &invocation] {
    fmt::print("{}", completion_script(command_tree(app), *shell));
    invocation.exit_code = kDone;
  });
}

}  // namespace graybox::cli
