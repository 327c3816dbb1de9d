// `graybox design sequential`: what measuring, estimating and designing again is worth, in a
// simulation with many repetitions (diagnosis/studies/sequential_design.hpp).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>
#include <vector>

#include "bench/pin_threads.hpp"
#include "cli/arguments/robot_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/studies/sequential_design.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"

namespace graybox::cli {
namespace {

struct SequentialArguments {
  RobotArguments robot;
  SequentialOptions options;
  double noise = 1e-4;
  std::string output;
  std::string summary;
  bool json = false;
};

// Numbers with as many digits as read back exactly would only show the last bits of a fit.
std::string cell(double value) { return fmt::format(",{:.8g}", value); }

std::string record_table(const std::vector<StageRecord>& records, const RobotModel& robot) {
  std::string text =
      "repetition,strategy,stage,experiments,positions,parameter_error,largest_error,"
      "expected_error,design_efficiency,fit_status,lack_of_fit";
  for (const std::string& name : robot.parameter_names()) text += ",theta_" + name;
  text += '\n';
  for (const StageRecord& record : records) {
    text += fmt::format("{},{},{},{},{}", record.repetition, to_string(record.strategy),
                        record.stage, record.experiments, record.positions);
    for (const double value : {record.parameter_error, record.largest_error, record.expected_error,
                               record.design_efficiency}) {
      text += cell(value);
    }
    text += fmt::format(",{}{}", to_string(record.fit_status), cell(record.lack_of_fit));
    for (const double value : record.theta) text += cell(value);
    text += '\n';
  }
  return text;
}

std::string summary_table(const std::vector<StageSummary>& summaries) {
  std::string text = "strategy,stage,experiments,repetitions,rejected_fits";
  for (const char* name : {"parameter_error", "expected_error", "design_efficiency"}) {
    for (const char* figure :
         {"mean", "standard_deviation", "lower_quartile", "median", "upper_quartile"}) {
      text += fmt::format(",{}_{}", name, figure);
    }
  }
  text += '\n';
  for (const StageSummary& summary : summaries) {
    text += fmt::format("{},{},{},{},{}", to_string(summary.strategy), summary.stage,
                        summary.experiments, summary.repetitions, summary.rejected_fits);
    for (const StageSummary::Spread* spread :
         {&summary.parameter_error, &summary.expected_error, &summary.design_efficiency}) {
      for (const double value : {spread->mean, spread->standard_deviation, spread->lower_quartile,
                                 spread->median, spread->upper_quartile}) {
        text += cell(value);
      }
    }
    text += '\n';
  }
  return text;
}

// After Ctrl-C the repetitions that are finished are kept.
std::vector<StageRecord> run(const RobotModel& robot, const PositionTable& positions,
                             const SequentialOptions& options) {
  catch_interrupts();
  CountProgress progress(fmt::format("information matrices of {} positions", positions.count()));
  std::vector<StageRecord> records;
  run_sequential_study(
      robot, positions, options,
      [&](const std::vector<StageRecord>& repetition) {
        records.insert(records.end(), repetition.begin(), repetition.end());
        return !interrupted();
      },
      [&](std::size_t done, std::size_t total) {
        if (done == 0) progress.begin("stage", total);
        (void)progress.update(done);
      });
  std::ranges::stable_sort(records, {}, &StageRecord::repetition);
  return records;
}

void print_summary(const std::vector<StageSummary>& summaries) {
  fmt::print(
      "median (quartiles) over the repetitions; error: rms of theta_hat / theta - 1\n"
      "{:<11} {:>5} {:>11}  {:<27} {:<21} {}\n",
      "strategy", "stage", "experiments", "parameter error [%]", "design efficiency",
      "rejected fits");
  for (const StageSummary& summary : summaries) {
    const auto& error = summary.parameter_error;
    const auto& efficiency = summary.design_efficiency;
    fmt::print("{:<11} {:>5} {:>11}  {:<27} {:<21} {}\n", to_string(summary.strategy),
               summary.stage, summary.experiments,
               fmt::format("{:.3g} ({:.3g} to {:.3g})", 100 * error.median,
                           100 * error.lower_quartile, 100 * error.upper_quartile),
               summary.stage == 0
                   ? std::string("-")
                   : fmt::format("{:.3f} ({:.3f} to {:.3f})", efficiency.median,
                                 efficiency.lower_quartile, efficiency.upper_quartile),
               summary.rejected_fits);
  }
}

nlohmann::ordered_json to_json(const SequentialArguments& arguments, std::size_t finished,
                               const std::vector<StageSummary>& summaries) {
  nlohmann::ordered_json json{{"command", "design sequential"},
                              {"repetitions", finished},
                              {"asked_repetitions", arguments.options.repetitions},
                              {"stages", arguments.options.stages},
                              {"experiments_per_stage", arguments.options.experiments_per_stage},
                              {"start_error", arguments.options.start_error},
                              {"noise", arguments.noise},
                              {"seed", arguments.options.seed}};
  json["summary"] = nlohmann::ordered_json::array();
  for (const StageSummary& summary : summaries) {
    json["summary"].push_back({{"strategy", to_string(summary.strategy)},
                               {"stage", summary.stage},
                               {"experiments", summary.experiments},
                               {"parameter_error", summary.parameter_error.median},
                               {"expected_error", summary.expected_error.median},
                               {"design_efficiency", summary.design_efficiency.median},
                               {"rejected_fits", summary.rejected_fits}});
  }
  return json;
}

int design_sequential(const SequentialArguments& arguments, Invocation& invocation) {
  if (!(arguments.noise > 0.0) || !std::isfinite(arguments.noise)) {
    throw InputError(fmt::format("--noise: must be positive, is {}", arguments.noise));
  }
  bench::pin_threads(arguments.options.threads, invocation.arguments);
  RobotModel robot = load_robot(arguments.robot);
  robot.velocity_psd_slope *= arguments.noise;
  const PositionTable positions = load_positions(arguments.robot, robot);
  const std::vector<StageRecord> records = run(robot, positions, arguments.options);
  const std::vector<StageSummary> summaries = summarise(records);
  FilesTogether files;
  if (!arguments.output.empty()) write_text_file(arguments.output, record_table(records, robot));
  if (!arguments.summary.empty()) write_text_file(arguments.summary, summary_table(summaries));
  files.commit();
  const std::size_t finished = summaries.empty() ? 0 : summaries.front().repetitions;
  const bool cut =
      interrupted() && finished < static_cast<std::size_t>(arguments.options.repetitions);
  const std::string ending = fmt::format("{}{} of {} repetitions", cut ? "interrupted after " : "",
                                         finished, arguments.options.repetitions);
  if (arguments.json) {
    if (cut) fmt::print(stderr, "graybox: {}\n", ending);
    fmt::print("{}\n", to_json(arguments, finished, summaries).dump());
  } else {
    if (!summaries.empty()) print_summary(summaries);
    fmt::print("{}\n", ending);
    if (!arguments.output.empty()) fmt::print("wrote {}\n", arguments.output);
    if (!arguments.summary.empty()) fmt::print("wrote {}\n", arguments.summary);
  }
  return finished == static_cast<std::size_t>(arguments.options.repetitions) ? kDone : kShort;
}

}  // namespace

void add_design_sequential_command(CLI::App& design, Invocation& invocation) {
  auto* command = design.add_subcommand(
      "sequential", "Simulate, estimate, design again: convergence from a wrong start");
  auto arguments = std::make_shared<SequentialArguments>();
  SequentialOptions& options = arguments->options;
  add_robot_options(*command, arguments->robot);
  command->add_option("--stages", options.stages, "stages of design, measurement and fit")
      ->capture_default_str();
  command
      ->add_option("--experiments-per-stage", options.experiments_per_stage,
                   "experiments in each stage")
      ->capture_default_str();
  command->add_option("--repetitions", options.repetitions, "repetitions, each with its own noise")
      ->capture_default_str();
  command
      ->add_option("--start-error", options.start_error,
                   "every parameter starts off by this, up or down: 0 <= e < 1")
      ->capture_default_str();
  command
      ->add_option("--noise", arguments->noise,
                   "factor on C_v of the model file; 1e-4: one optimally placed experiment has a\n"
                   "standard deviation of about 1 %, where the file's own is the paper's 100 %")
      ->capture_default_str();
  command->add_option("--seed", options.seed, "of starts and noise")->capture_default_str();
  add_threads(*command, options.threads);
  command->add_option("-o,--output", arguments->output, "write a line a stage as CSV");
  command->add_option("--summary", arguments->summary, "write means, spreads, quartiles as CSV");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Strategies: sequential designs each stage for the estimate so far, fixed for the wrong\n"
      "start, oracle for the truth; random draws positions. The truth is the model file's robot.\n"
      "Ctrl-C keeps the repetitions that are finished (exit code 1).\n"
      "Examples:\n"
      "  graybox design sequential -o sequential.csv --summary sequential_stages.csv\n"
      "  graybox design sequential --stages 4 --experiments-per-stage 15 --noise 1e-3 --json\n"
      "  graybox design sequential --grid 500 --repetitions 10 --start-error 0.2");
  command->callback([arguments, &invocation] {
    invocation.exit_code = design_sequential(*arguments, invocation);
  });
}

}  // namespace graybox::cli
