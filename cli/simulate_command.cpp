#include <fmt/format.h>

#include <cstdint>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "commands.hpp"
#include "console.hpp"
#include "graybox/diagnosis/simulation/simulated_campaign.hpp"
#include "graybox/problems/sha256.hpp"
#include "interrupt.hpp"

namespace graybox::cli {
namespace {

struct SimulateArguments {
  std::string model;
  std::string plan;
  std::uint64_t seed = 1;
  int threads = 1;
  std::string output;
  bool json = false;
};

// Models and plans are told apart by their bytes.
void add_file(Sha256& hash, const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  hash.update(text.str());
}

std::string identity_of(const SimulateArguments& arguments) {
  Sha256 hash;
  add_file(hash, arguments.model);
  add_file(hash, arguments.plan);
  return hash.hexadecimal();
}

int simulate(const SimulateArguments& arguments) {
  const RobotModel robot = load_robot_model(arguments.model);
  const ExcitationPlan plan = read_plan(arguments.plan, robot);
  catch_interrupts();
  SimulationOptions options{.seed = arguments.seed,
                            .threads = arguments.threads,
                            .identity = identity_of(arguments),
                            .keep_going = [] { return !interrupted(); },
                            .report = {}};
  CountProgress progress("recording", planned_experiments(plan, robot.motor_count()).size());
  options.report = [&](std::size_t done, std::size_t) { (void)progress.update(done); };
  const SimulationOutcome outcome = simulate_campaign(robot, plan, arguments.output, options);
  if (arguments.json) {
    const nlohmann::ordered_json line{{"campaign", arguments.output},
                                      {"recordings", outcome.recordings},
                                      {"already_there", outcome.already_there},
                                      {"complete", outcome.complete}};
    fmt::print("{}\n", line.dump());
  } else if (outcome.complete) {
    fmt::print("wrote {}/campaign.yaml and {} recordings ({} were there)\n", arguments.output,
               outcome.recordings, outcome.already_there);
  } else {
    fmt::print("interrupted; the same command goes on where it was\n");
  }
  return outcome.complete ? kDone : kShort;
}

}  // namespace

void add_simulate_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("simulate", "Simulate the experiments of a plan and record a campaign");
  auto arguments = std::make_shared<SimulateArguments>();
  command->add_option("model", arguments->model, "graybox-robot/1 file (YAML)")->required();
  command->add_option("plan", arguments->plan, "graybox-plan/1 file (YAML)")->required();
  command->add_option("--seed", arguments->seed, "of phases and noise")->capture_default_str();
  command->add_option("--threads", arguments->threads, "threads; the result is the same")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("-o,--output", arguments->output, "campaign folder to write")->required();
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Ctrl-C loses the recordings in hand and none that is written; the same command goes on "
      "where it was.\n"
      "Example:\n  graybox simulate robot.yaml plan.yaml --seed 7 --threads 2 -o campaign/");
  command->callback([arguments, &invocation] { invocation.exit_code = simulate(*arguments); });
}

}  // namespace graybox::cli
