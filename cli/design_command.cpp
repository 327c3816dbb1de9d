// `graybox design ...`: designs that need more than one information set. One file each
// (design_x_command.cpp), added here.
#include "commands.hpp"

namespace graybox::cli {

void add_design_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("design", "Designs beyond one information set");
  command->require_subcommand(1);
  add_design_spectrum_command(*command, invocation);
  add_design_robust_command(*command, invocation);
  add_design_efficiency_command(*command, invocation);
}

}  // namespace graybox::cli
