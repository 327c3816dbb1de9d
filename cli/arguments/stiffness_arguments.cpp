#include "cli/arguments/stiffness_arguments.hpp"

namespace graybox::cli {

void add_stiffness_options(CLI::App& command, StiffnessArguments& arguments) {
  command.add_option("--samples", arguments.samples, "how many samples of the stiffness to draw")
      ->capture_default_str();
  command
      .add_option("--uncertainty", arguments.options.uncertainty,
                  "every stiffness factor is uniform on 1 - uncertainty to 1 + uncertainty")
      ->capture_default_str();
  command.add_option("--seed", arguments.options.seed, "of the samples")->capture_default_str();
}

}  // namespace graybox::cli
