#include "cli/arguments/time_limit_argument.hpp"

namespace graybox::cli {

void add_time_limit(CLI::App& command, OnStop on_stop) {
  command
      .add_option_function<double>(
          "--time-limit", [on_stop](double seconds) { limit_command(seconds, on_stop); },
          on_stop != OnStop::kLosesNothing
              ? "wall seconds; what was found is handed over (default: none)"
              : "wall seconds; nothing is handed over then (default: none)")
      ->check(CLI::Range(0.01, 1e8));
}

}  // namespace graybox::cli
