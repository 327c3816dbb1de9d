// `graybox fit`: the parameters of a model from the recordings of a campaign.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "cli/commands/commands.hpp"
#include "cli/fit/fit_arguments.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/verdict/extended_model.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox::cli {
namespace {

struct FittedFormat {
  std::string_view name;
  FitReport (*fit)(const FitArguments&);
  bool takes_elements = false;  // --physics
  bool is_regression = false;   // --refine, --equal-noise, --decimate
  bool has_lines = false;       // --lines
};
constexpr FittedFormat kFormats[] = {
    {.name = "graybox-robot/1", .fit = fit_robot, .has_lines = true},
    {.name = "graybox-rigid-robot/1",
     .fit = fit_rigid_robot,
     .takes_elements = true,
     .is_regression = true},
    {.name = "graybox-lumped/1", .fit = fit_lumped, .takes_elements = true},
};

const FittedFormat& format_of(const std::string& model) {
  const YamlField field = YamlField::load(model).at("format");
  const std::string name = field.text();
  const auto* found = std::ranges::find(kFormats, name, &FittedFormat::name);
  if (found != std::end(kFormats)) return *found;
  std::string known;
  for (const FittedFormat& each : kFormats) {
    known += (known.empty() ? "" : ", ") + std::string(each.name);
  }
  field.fail(fmt::format("is '{}'; models that can be fitted: {}", name, known));
}

void write_model(const FitArguments& arguments, const FitReport& report) {
  const std::vector<std::filesystem::path> physics(arguments.physics.begin(),
                                                   arguments.physics.end());
  write_text_file(arguments.written_model,
                  fitted_model_text(arguments.model, arguments.written_model, report, physics));
}

int execute(const FitArguments& arguments) {
  const FittedFormat& format = format_of(arguments.model);
  if (!format.takes_elements && (!arguments.physics.empty() || !arguments.refine.empty() ||
                                 arguments.equal_noise || arguments.decimation != 1)) {
    throw InputError(fmt::format(
        "--physics, --refine, --equal-noise and --decimate are not for {} models, as {} is",
        format.name, arguments.model));
  }
  if (!format.is_regression &&
      (!arguments.refine.empty() || arguments.equal_noise || arguments.decimation != 1)) {
    throw InputError(
        fmt::format("--refine, --equal-noise and --decimate are not for {} models", format.name));
  }
  if (!format.has_lines && arguments.lines != "none") {
    throw InputError(fmt::format("--lines is for graybox-robot/1 models; {} is {}", arguments.model,
                                 format.name));
  }
  if (!format.takes_elements && !arguments.written_model.empty()) {
    throw InputError(fmt::format("--write is for lumped models and rigid robots; {} is {}",
                                 arguments.model, format.name));
  }
  for (const std::string* file : {&arguments.output, &arguments.written_model}) {
    if (!file->empty()) require_writable(*file);
  }
  catch_interrupts();
  FitReport report = format.fit(arguments);
  judge_plausibility(report);
  if (!arguments.output.empty()) write_fit(arguments.output, report);
  if (!arguments.written_model.empty()) write_model(arguments, report);
  if (arguments.json) {
    fmt::print("{}\n", fit_json(report).dump());
  } else {
    fmt::print("{}", fit_text(report));
    for (const std::string* file : {&arguments.output, &arguments.written_model}) {
      if (!file->empty()) fmt::print("wrote {}\n", *file);
    }
  }
  return report.converged() ? kDone : kShort;
}

}  // namespace

void add_fit_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("fit", "Estimate the parameters of a model from recordings");
  auto arguments = std::make_shared<FitArguments>();
  command->add_option("model", arguments->model, "model file (YAML)")->required();
  command
      ->add_option("campaign", arguments->campaign,
                   "graybox-campaign/1 file (YAML), or the folder of a campaign.yaml")
      ->required();
  command->add_option("-o,--output", arguments->output, "write the result to this file (JSON)");
  command->add_option("--write", arguments->written_model,
                      "write the model with the fitted values (lumped models, rigid robots)");
  command->add_option("--threads", arguments->threads, "threads")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "of the starts after the first")
      ->capture_default_str();
  command
      ->add_option("--starts", arguments->starts,
                   "starts of the search, at most; it ends when two agree")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_flag("--all-starts", arguments->all_starts,
                    "run all starts, to see how many find the optimum (robots)");
  command
      ->add_option(
          "--lines", arguments->lines,
          "flexible robots: go on to fit the spectral lines themselves, with local models or "
          "the full robot: none, local or full")
      ->check(CLI::IsMember({"none", "local", "full"}))
      ->capture_default_str();
  command->add_option(
      "--physics", arguments->physics,
      "graybox-physics/1 files with further elements (rigid robots, lumped models)");
  command->add_option("--refine", arguments->refine,
                      "element.parameter to estimate although it is not linear (rigid robots)");
  command
      ->add_option("--decimate", arguments->decimation,
                   "low-pass torques and columns alike and keep every Nth sample (rigid robots)")
      ->check(CLI::Range(1, 1000000));
  command->add_flag("--equal-noise", arguments->equal_noise,
                    "all joints' torques are equally noisy: ordinary least squares (rigid robots)");
  command
      ->add_option("--initial-state", arguments->initial_state,
                   "lumped models: free (estimated), measured or rest")
      ->check(CLI::IsMember({"free", "measured", "rest"}))
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Exit codes: 0 converged; 1 not, the best so far is printed and written; 2 bad input.\n"
      "Examples:\n"
      "  graybox fit robot.yaml campaign/ -o fit.json\n"
      "  graybox fit drive.yaml campaign/ --physics friction.yaml --write fitted.yaml\n"
      "  graybox fit robot.yaml campaign/ --lines full\n"
      "  graybox fit robot.yaml campaign/ --starts 30 --threads 2 --json");
  command->callback([arguments, &invocation] { invocation.exit_code = execute(*arguments); });
}

}  // namespace graybox::cli
