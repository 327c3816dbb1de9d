// graybox: the command. Parses, calls the libraries, prints.
#include <cstdio>
#include <exception>
#include <memory>
#include <new>
#include <string>

#include "cli/arguments/option_checks.hpp"
#include "cli/commands/commands.hpp"
#include "cli/front/diagnosis_commands.hpp"
#include "cli/front/help_formatter.hpp"
#include "cli/front/help_text.hpp"
#include "cli/front/output_paths.hpp"
#include "cli/front/task_list.hpp"
#include "cli/process/start_up.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/program_version.hpp"
#include "problems/base/shortened.hpp"
#include "problems/base/stop.hpp"

namespace {

// The subcommand that was being parsed, for the hint at its --help.
std::string command_name(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? app.get_name() : app.get_name() + " " + command_name(*chosen.front());
}

// CLI11 reports a missing subcommand where an unknown one was given; this names it.
std::string unknown_command(const CLI::App& app, int argc, char** argv) {
  const CLI::App* level = &app;
  std::string path;
  for (int i = 1; i < argc && argv[i][0] != '-'; ++i) {
    const CLI::App* next = nullptr;
    std::string known;
    for (const CLI::App* command : level->get_subcommands([](const CLI::App*) { return true; })) {
      if (command->get_name() == argv[i]) next = command;
      if (command->get_group().empty()) continue;  // not for users
      known += (known.empty() ? "" : ", ") + command->get_name();
    }
    if (known.empty()) return {};
    path += (path.empty() ? "" : " ") + std::string(argv[i]);
    if (next == nullptr) {
      if (std::string reason = graybox::cli::reason_for_absence(path); !reason.empty()) {
        return reason;
      }
      return "unknown command '" + std::string(argv[i]) + "'; choose one of " + known;
    }
    level = next;
  }
  return {};
}

constexpr std::size_t kLongestMessage = 1000;  // characters; file, field and remedy are at its ends

int complain(const std::string& line) {
  std::fprintf(stderr, "graybox: %s\n",
               graybox::shortened(line.substr(0, line.find('\n')), kLongestMessage).c_str());
  return graybox::cli::kBadInput;
}

// In the order of the tasks (task_list.cpp), which is that of --help.
void add_commands(CLI::App& app, graybox::cli::Invocation& invocation) {
  graybox::cli::add_solve_command(app, invocation);
  graybox::cli::add_design_command(app, invocation);
  graybox::cli::add_exact_command(app, invocation);
  graybox::cli::add_check_command(app, invocation);
  graybox::cli::add_plot_command(app, invocation);
  graybox::cli::add_problem_command(app, invocation);
  graybox::cli::add_diagnosis_commands(app, invocation);
  graybox::cli::add_ellipsoid_command(app, invocation);
  graybox::cli::add_solvers_command(app, invocation);
  graybox::cli::add_study_command(app, invocation);
  graybox::cli::add_paper_command(app, invocation);
  graybox::cli::add_completion_command(app, invocation);
  graybox::cli::add_help_command(app, invocation);
}

int run(int argc, char** argv) {
  CLI::App app("Optimal experiment design for gray-box models, with a certificate.", "graybox");
  app.require_subcommand(1);
  app.set_version_flag("--version", graybox::written_by(), "Print version and commit and exit");
  app.formatter(std::make_shared<graybox::cli::HelpFormatter>(graybox::cli::terminal_columns()));
  graybox::cli::Invocation invocation{argv};
  add_commands(app, invocation);
  graybox::cli::group_by_task(app);
  graybox::cli::check_common_options(app);
  app.parse_complete_callback([&app] {
    graybox::cli::require_values(app);
    graybox::cli::require_distinct_outputs(app);
  });
  if (argc == 1) {
    std::fputs(graybox::cli::task_list().c_str(), stdout);
    return graybox::cli::kDone;
  }
  if (const std::string line = unknown_command(app, argc, argv); !line.empty()) {
    return complain(line);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help
    return complain(std::string(error.what()) + "; see " + command_name(app) + " --help");
  } catch (const graybox::InputError& error) {
    return complain(error.what());
  } catch (const graybox::Stopped&) {
    complain(graybox::stop_was_asked_for() ? "interrupted before there was anything to hand over"
                                           : "stopped before there was anything to hand over");
    return graybox::cli::kShort;
  } catch (const std::bad_alloc& error) {
    complain(graybox::describe_shortage(error));
    return graybox::cli::kShort;
  } catch (const std::exception& error) {
    if (graybox::cli::standard_output_failed()) return graybox::cli::kShort;
    complain(std::string("internal error: ") + error.what());
    return graybox::cli::kShort;
  }
  return invocation.exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  graybox::cli::start_up(argv);
  return graybox::cli::finish(run(argc, argv));
}
