// `graybox fit`: the parameters of a model from the recordings of a campaign.
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "cli/arguments/machine_files.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/arguments/time_limit_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/command_line.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/prediction/fit_page.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/runs/model_fit.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"

namespace graybox::cli {
namespace {

struct Arguments {
  ModelFitRequest request;
  std::string output;
  std::string page;  // HTML
  bool json = false;
};

FitReport run(ModelFitRequest request) {
  catch_interrupts();
  std::optional<CountProgress> progress;
  request.report = [&](std::size_t done, std::size_t total) {
    if (!progress) progress.emplace("recording", total);
    (void)progress->update(done);
  };
  return fit_model(request);
}

// What a model predicts; none for formats that are not simulated, and where something is unknown.
std::optional<ModelPrediction> predicted_by(const std::filesystem::path& model,
                                            const std::vector<std::string>& physics,
                                            const ModelFitRequest& request) {
  try {
    return predict_recordings(model, read_campaign(request.campaign),
                              {physics.begin(), physics.end()}, request.threads);
  } catch (const InputError&) {
    return {};
  }
}

// The fitted model stands beside the page while its recordings are predicted.
std::string page_of(const Arguments& arguments, const FitReport& report, PageOrigin origin) {
  FitPredictions predictions;
  std::string text;
  ModelFitRequest request = arguments.request;
  if (is_simulated(request)) {
    request.written_model = arguments.page + ".model.yaml";
    text = fitted_model_text(request, report);
    write_text_file(request.written_model, text);
    predictions.before = predicted_by(request.model, request.physics, request);
    predictions.after = predicted_by(request.written_model, {}, request);
    std::filesystem::remove(request.written_model);
  }
  return fit_page(report, predictions, text, origin);
}

int execute(const Arguments& arguments, const Invocation& invocation) {
  const auto start = std::chrono::steady_clock::now();
  const ModelFitRequest& request = arguments.request;
  require_fit_options(request);
  for (const std::string* file : {&arguments.output, &request.written_model, &arguments.page}) {
    if (!file->empty()) require_writable(*file);
  }
  const FitReport report = run(request);
  std::string page;
  if (!arguments.page.empty()) {
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    page = page_of(arguments, report,
                   {.command = command_line(invocation.arguments),
                    .files = {{request.model, "model"}, {report.campaign, "campaign"}},
                    .seconds = seconds.count()});
  }
  FilesTogether files;
  if (!arguments.output.empty()) write_fit(arguments.output, report);
  if (!request.written_model.empty()) {
    write_text_file(request.written_model, fitted_model_text(request, report));
  }
  if (!arguments.page.empty()) write_text_file(arguments.page, page);
  files.commit();
  if (arguments.json) {
    fmt::print("{}\n", fit_json(report).dump());
  } else {
    fmt::print("{}", fit_text(report));
    for (const std::string* file : {&arguments.output, &request.written_model, &arguments.page}) {
      if (!file->empty()) fmt::print("wrote {}\n", *file);
    }
  }
  return report.converged() ? kDone : kShort;
}

constexpr const char* kFitFooter =
    "Exit codes: 0 converged; 1 not, the best so far is printed and written; 2 bad input.\n"
    "Examples:\n"
    "  graybox fit robot.yaml campaign/ -o fit.json\n"
    "  graybox fit drive.yaml campaign/ --physics friction.yaml --write fitted.yaml\n"
    "  graybox fit drive.yaml campaign/ --report fit.html\n"
    "  graybox fit robot.yaml campaign/ --lines full\n"
    "  graybox fit robot.yaml campaign/ --starts 30 --json";

}  // namespace

void add_fit_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("fit", "Estimate the parameters of a model from recordings");
  auto arguments = std::make_shared<Arguments>();
  add_machine_files(*command, arguments->request.model, arguments->request.campaign);
  command->add_option("-o,--output", arguments->output, "write the result to this file (JSON)");
  command->add_option("--write", arguments->request.written_model,
                      "write the model with the fitted values (lumped models, rigid robots)");
  command->add_option("--report", arguments->page,
                      "write one page with parameters and traces (HTML)");
  add_threads(*command, arguments->request.threads);
  command->add_option("--seed", arguments->request.seed, "of the starts after the first")
      ->capture_default_str();
  command
      ->add_option("--starts", arguments->request.starts,
                   "starts of the search, at most; it ends when two agree")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_flag("--all-starts", arguments->request.all_starts,
                    "run all starts, to see how many find the optimum (robots)");
  command
      ->add_option(
          "--lines", arguments->request.lines,
          "flexible robots: go on to fit the spectral lines themselves, with local models or "
          "the full robot: none, local or full")
      ->check(CLI::IsMember({"none", "local", "full"}))
      ->capture_default_str();
  command->add_option(
      "--physics", arguments->request.physics,
      "graybox-physics/1 files with further elements (rigid robots, lumped models)");
  command->add_option("--refine", arguments->request.refine,
                      "element.parameter to estimate although it is not linear (rigid robots)");
  command
      ->add_option("--decimate", arguments->request.decimation,
                   "low-pass torques and columns alike and keep every Nth sample (rigid robots)")
      ->check(CLI::Range(1, 1000000));
  command->add_flag("--equal-noise", arguments->request.equal_noise,
                    "all joints' torques are equally noisy: ordinary least squares (rigid robots)");
  command
      ->add_option("--initial-state", arguments->request.initial_state,
                   "lumped models: free (estimated), measured or rest")
      ->check(CLI::IsMember({"free", "measured", "rest"}))
      ->capture_default_str();
  add_time_limit(*command, OnStop::kHandsOverInTime);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(kFitFooter);
  command->callback([arguments, &invocation] {
    find_machine_files("fit", arguments->request.model, arguments->request.campaign);
    invocation.exit_code = execute(*arguments, invocation);
  });
}

}  // namespace graybox::cli
