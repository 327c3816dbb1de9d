// The subcommands of `graybox`, one file each. Each add_x_command() declares its options on `app`
// and attaches a callback that does the work. The callback reports through Invocation::exit_code
// and throws InputError for bad input (main.cpp prints it and exits with 2).
#pragma once

#include <CLI/CLI.hpp>

#include "cli/process/exit_code.hpp"

namespace graybox::cli {

struct Invocation {
  char** arguments = nullptr;  // argv of main
  int exit_code = kDone;
};

void add_problem_command(CLI::App& app, Invocation& invocation);
void add_solvers_command(CLI::App& app, Invocation& invocation);
void add_solve_command(CLI::App& app, Invocation& invocation);
void add_check_command(CLI::App& app, Invocation& invocation);
void add_plot_command(CLI::App& app, Invocation& invocation);
void add_exact_command(CLI::App& app, Invocation& invocation);
void add_ellipsoid_command(CLI::App& app, Invocation& invocation);
void add_simulate_command(CLI::App& app, Invocation& invocation);
void add_recordings_command(CLI::App& app, Invocation& invocation);
void add_responses_command(CLI::App& app, Invocation& invocation);
void add_fit_command(CLI::App& app, Invocation& invocation);
void add_diagnose_command(CLI::App& app, Invocation& invocation);
void add_predict_command(CLI::App& app, Invocation& invocation);
void add_export_command(CLI::App& app, Invocation& invocation);
void add_model_command(CLI::App& app, Invocation& invocation);
void add_challenge_command(CLI::App& app, Invocation& invocation);
void add_study_command(CLI::App& app, Invocation& invocation);
void add_help_command(CLI::App& app, Invocation& invocation);
void add_completion_command(CLI::App& app, Invocation& invocation);
void add_paper_command(CLI::App& app, Invocation& invocation);
void add_design_command(CLI::App& app, Invocation& invocation);  // the group of the designs below
void add_design_criteria_command(CLI::App& design, Invocation& invocation);
void add_design_continuous_command(CLI::App& design, Invocation& invocation);
void add_design_sequential_command(CLI::App& design, Invocation& invocation);
void add_design_spectrum_command(CLI::App& design, Invocation& invocation);
void add_design_robust_command(CLI::App& design, Invocation& invocation);
void add_design_efficiency_command(CLI::App& design, Invocation& invocation);
void add_design_verify_command(CLI::App& design, Invocation& invocation);
void add_design_plan_command(CLI::App& design, Invocation& invocation);

}  // namespace graybox::cli
