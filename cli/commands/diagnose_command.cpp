// `graybox diagnose`: what physics a model lacks, from recordings.
#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "cli/arguments/machine_files.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/command_line.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/runs/diagnosis_run.hpp"
#include "problems/base/stop.hpp"

namespace graybox::cli {
namespace {

struct Arguments {
  DiagnosisRequest request;
  std::optional<double> time_limit;  // s
  bool json = false;
};

// The steps of the search, on one line of a terminal that is rewritten.
class StepProgress {
 public:
  StepProgress() : terminal_(isatty(fileno(stderr)) != 0) {}
  ~StepProgress() { show(""); }
  StepProgress(const StepProgress&) = delete;
  StepProgress& operator=(const StepProgress&) = delete;

  void show(const std::string& step) const {
    if (terminal_) fmt::print(stderr, "\r\033[K{}", step);
    if (terminal_) std::fflush(stderr);
  }

 private:
  bool terminal_;
};

DiagnosisAnswer run(DiagnosisRequest request) {
  const StepProgress progress;
  request.begin = [&progress] {
    catch_interrupts();
    progress.show("reading the recordings, fitting the model");
  };
  request.search.proceed = [&progress](const std::string& step) {
    progress.show(step);
    return true;
  };
  return run_diagnosis(std::move(request));
}

// What verdict.json lists, the page first and the figures by their folder.
std::string written_files(const nlohmann::ordered_json& verdict) {
  std::string text = "report.html";
  bool has_figures = false;
  for (const auto& file : verdict.at("files")) {
    const std::string name = file.get<std::string>();
    const bool is_figure = name.starts_with("figures/");
    has_figures = has_figures || is_figure;
    if (!is_figure && name != "report.html") text += ", " + name;
  }
  return text + (has_figures ? ", figures" : "");
}

void print(const DiagnosisRequest& request, const DiagnosisAnswer& answer) {
  fmt::print("verdict: {}\n", to_string(answer.diagnosis.verdict));
  if (!answer.method_line.empty()) fmt::print("{}\n", answer.method_line);
  for (const std::string& line : answer.words()) fmt::print("{}\n", line);
  for (const std::string& line : answer.warnings) fmt::print("The recordings: {}\n", line);
  if (!request.report.empty()) {
    fmt::print("wrote {}/{}\n", request.report, written_files(answer.verdict));
  }
}

int execute(Arguments& arguments, const Invocation& invocation) {
  find_machine_files("diagnose", arguments.request.model, arguments.request.campaign);
  arguments.request.command = command_line(invocation.arguments);
  if (arguments.time_limit) limit_process(*arguments.time_limit);
  const DiagnosisAnswer answer = run(arguments.request);
  if (arguments.json) {
    fmt::print("{}\n", answer.verdict.dump());
  } else {
    print(arguments.request, answer);
  }
  return answer.diagnosis.verdict == Verdict::kUnknown ? kShort : kDone;
}

}  // namespace

void add_diagnose_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand(
      "diagnose", "Find the physics that a model lacks: where, what, and how sure");
  auto arguments = std::make_shared<Arguments>();
  add_machine_files(*command, arguments->request.model, arguments->request.campaign);
  command->add_option("-o,--output", arguments->request.report,
                      "write report.html, verdict.json, model_extended.yaml, physics.yaml and "
                      "figures into this folder");
  command
      ->add_option("--method", arguments->request.method,
                   "periodic, force_balance or prediction_error (default: what the model and the "
                   "recordings ask for)")
      ->check(CLI::IsMember({"auto", "periodic", "force_balance", "prediction_error"}));
  add_threads(*command, arguments->request.threads);
  command
      ->add_option("--level", arguments->request.search.level,
                   "false alarms where nothing is missing, all hypotheses together")
      ->check(CLI::Range(0.0005, 0.5))
      ->capture_default_str();
  command
      ->add_option("--effects", arguments->request.search.effect_limit,
                   "effects to look for, at most (default: 4, or 24 where the noise is not known)")
      ->check(CLI::Range(1, 50));
  command->add_option("--without", arguments->request.search.excluded_laws,
                      "leave this law out of the catalogue; once for each");
  command->add_option("--laws", arguments->request.law_files,
                      "laws of your own, graybox-laws/1 files, besides the catalogue");
  command->add_option("--places", arguments->request.place_files,
                      "places of your own, graybox-places/1 files, besides those of the model");
  command->add_flag("--ignore-faults", arguments->request.search.ignore_channel_faults,
                    "search although wires, signs or units look wrong");
  command
      ->add_option("--time-limit", arguments->time_limit,
                   "stop after so many seconds with what has been found until then")
      ->check(CLI::Range(0.01, 1e6));
  command
      ->add_option("--seed", arguments->request.search.seed,
                   "of the draws that calibrate the tests")
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Exit codes: 0 nothing missing, explained or ambiguous; 1 unknown; 2 bad input.\n"
      "Examples:\n"
      "  graybox diagnose robot.yaml campaign/ -o report\n"
      "  graybox diagnose drive.yaml campaign/ --without coulomb --json\n"
      "  graybox diagnose drive.yaml campaign/ --laws my_laws.yaml --places my_places.yaml -o "
      "report");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = execute(*arguments, invocation); });
}

}  // namespace graybox::cli
