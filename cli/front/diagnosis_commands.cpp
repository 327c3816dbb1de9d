#include "cli/front/diagnosis_commands.hpp"

#include "diagnosis/estimation/quiet_ceres.hpp"

namespace graybox::cli {

void add_diagnosis_commands(CLI::App& app, Invocation& invocation) {
  silence_ceres();
  add_model_command(app, invocation);
  add_recordings_command(app, invocation);
  add_diagnose_command(app, invocation);
  add_responses_command(app, invocation);
  add_simulate_command(app, invocation);
  add_fit_command(app, invocation);
  add_predict_command(app, invocation);
  add_export_command(app, invocation);
  add_challenge_command(app, invocation);
  CLI::App& design = *app.get_subcommand("design");
  add_design_sequential_command(design, invocation);
  add_design_verify_command(design, invocation);
}

std::string reason_for_absence(const std::string& /*command*/) { return {}; }

}  // namespace graybox::cli
