// `graybox design ...`: designs beyond one solve of one information set. One file each
// (design_x_command.cpp), added here.
#include "cli/commands/commands.hpp"
#include "cli/design/design_discriminate_command.hpp"

namespace graybox::cli {

void add_design_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("design", "Designs beyond one criterion and one information set");
  command->require_subcommand(1);
  add_design_criteria_command(*command, invocation);
  add_design_discriminate_command(*command, invocation);
  add_design_plan_command(*command, invocation);
  add_design_continuous_command(*command, invocation);
  add_design_spectrum_command(*command, invocation);
  add_design_robust_command(*command, invocation);
  add_design_efficiency_command(*command, invocation);
  command->footer(
      "Examples:\n"
      "  graybox design robust --samples 50 --uncertainty 0.5 -o worst_case.json\n"
      "  graybox design criteria set.h5 -o tables");
}

}  // namespace graybox::cli
