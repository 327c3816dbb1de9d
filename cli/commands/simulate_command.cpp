// `graybox simulate`: the experiments of a plan, simulated and recorded as a campaign.
#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "bench/study/progress.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/arguments/time_limit_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "diagnosis/simulation/simulation_identity.hpp"
#include "problems/base/error.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox::cli {
namespace {

struct SimulateArguments {
  std::string model;
  std::string plan;
  std::string hidden;
  std::uint64_t seed = 1;
  int threads = 1;
  std::string output;
  bool laws = false;
  bool json = false;
};

SimulationOutcome run(const SimulateArguments& arguments) {
  std::optional<std::filesystem::path> hidden;
  if (!arguments.hidden.empty()) hidden = arguments.hidden;
  const SimulatedSystem system = load_system(arguments.model, hidden);
  const ExcitationPlan plan = read_plan(arguments.plan, system);
  catch_interrupts(OnStop::kLosesNothing);
  CountProgress progress(
      "recording",
      planned_experiments(plan, static_cast<Eigen::Index>(system.inputs.size())).size());
  const SimulationOptions options{
      .seed = arguments.seed,
      .threads = arguments.threads,
      .identity = simulation_identity(system, arguments.plan),
      .keep_going = [] { return !interrupted(); },
      .report = [&](std::size_t done, std::size_t) { (void)progress.update(done); },
      .forecast =
          [&](double seconds) {
            progress.clear();
            fmt::print(stderr,
                       "graybox: this will take about {}; Ctrl-C stops, and the same command "
                       "goes on where it was\n",
                       bench::readable_duration(seconds));
          }};
  return simulate_campaign(system, plan, arguments.output, options);
}

int report(const SimulateArguments& arguments, const SimulationOutcome& outcome) {
  if (arguments.json) {
    const nlohmann::ordered_json line{{"campaign", arguments.output},
                                      {"recordings", outcome.recordings},
                                      {"already_there", outcome.already_there},
                                      {"complete", outcome.complete}};
    fmt::print("{}\n", line.dump());
  } else if (outcome.complete) {
    const std::string reused = outcome.already_there == 0
                                   ? std::string()
                                   : fmt::format(" ({} were there)", outcome.already_there);
    fmt::print("wrote {}/campaign.yaml and {} recordings{}\n", arguments.output, outcome.recordings,
               reused);
  } else {
    fmt::print("interrupted; the same command goes on where it was\n");
  }
  return outcome.complete ? kDone : kShort;
}

int simulate(const SimulateArguments& arguments) {
  try {
    return report(arguments, run(arguments));
  } catch (const UnstableMotion& error) {
    fmt::print(stderr, "graybox: {}\n", error.what());
    return kShort;
  }
}

int list_laws(bool as_json) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  std::vector<const LawEntry*> laws;
  for (const auto* entries : {&law_catalogue(), &supplementary_laws()}) {
    for (const LawEntry& law : *entries) laws.push_back(&law);
  }
  for (const LawEntry* entry : laws) {
    const LawEntry& law = *entry;
    const bool at_signal = find_law(law.name, true) == &law;
    const char* place = at_signal ? "actuator or sensor" : "element";
    nlohmann::ordered_json units = nlohmann::ordered_json::object();
    std::string text;
    for (const LawParameter& parameter : law.parameters) {
      units[parameter.name] = parameter.unit;
      text += fmt::format("{}{} [{}]", text.empty() ? "" : ", ", parameter.name, parameter.unit);
      if (parameter.if_absent) text += fmt::format(" ({:g} if left out)", *parameter.if_absent);
    }
    list.push_back({{"law", law.name},
                    {"location", place},
                    {"description", law.description},
                    {"parameters", units}});
    if (!as_json) {
      fmt::print("{} ({}): {}\n    {}\n", law.name, place, law.description, text);
    }
  }
  if (as_json) {
    fmt::print("{}\n", list.dump());
  } else {
    fmt::print(
        "F, x, I: the units of force, deflection and inertia of the place; at an actuator or "
        "sensor F is the unit of its signal, x that of an input that drives it\n");
  }
  return kDone;
}

int execute(const SimulateArguments& arguments) {
  if (arguments.laws) return list_laws(arguments.json);
  if (arguments.model.empty() || arguments.plan.empty() || arguments.output.empty()) {
    throw InputError("simulate: needs a model, a plan and -o FOLDER; see graybox simulate --help");
  }
  return simulate(arguments);
}

}  // namespace

void add_simulate_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("simulate", "Simulate the experiments of a plan and record a campaign");
  auto arguments = std::make_shared<SimulateArguments>();
  command->add_option("model", arguments->model, "graybox-robot/1 or graybox-lumped/1 file (YAML)");
  command->add_option("plan", arguments->plan, "graybox-plan/1 file (YAML)");
  command->add_option("--hidden", arguments->hidden,
                      "graybox-physics/1 file with elements that the model does not have");
  command->add_option("--seed", arguments->seed, "of phases and noise")->capture_default_str();
  add_threads(*command, arguments->threads);
  command->add_option("-o,--output", arguments->output, "campaign folder to write");
  command->add_flag("--laws", arguments->laws, "list the laws of elements and their parameters");
  add_time_limit(*command, OnStop::kLosesNothing);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Ctrl-C loses the recordings in hand and none that is written; the same command goes on "
      "where "
      "it was.\n"
      "Examples:\n"
      "  graybox simulate robot.yaml plan.yaml --seed 7 -o campaign/\n"
      "  graybox simulate robot.yaml plan.yaml --hidden physics.yaml -o campaign/\n"
      "  graybox simulate --laws");
  command->callback([arguments, &invocation] { invocation.exit_code = execute(*arguments); });
}

}  // namespace graybox::cli
