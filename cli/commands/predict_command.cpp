// `graybox predict`: how well a model predicts recordings as it stands.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/arguments/machine_files.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/arguments/time_limit_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/command_line.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/prediction/model_prediction.hpp"
#include "diagnosis/prediction/prediction_json.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"

namespace graybox::cli {
namespace {

struct Arguments {
  std::string model, campaign, output;
  std::vector<std::string> physics;
  std::string initial_state = "measured";
  int threads = 1;
  bool json = false;
};

std::string cell(const PredictedChannel& channel) {
  if (std::isnan(channel.error)) return "too short";
  if (!std::isfinite(channel.error)) return "unbounded";
  if (!(channel.signal > 0.0)) return "constant";
  return fmt::format("{:.3g}", channel.nrmse());
}

// A line for each channel of each recording, a column for each horizon.
std::string table_of(const ModelPrediction& prediction) {
  std::vector<double> horizons;
  std::size_t widest = 9, widest_channel = 7;
  for (const RecordingPrediction& recording : prediction.recordings) {
    if (std::ranges::find(horizons, recording.ahead) == horizons.end()) {
      horizons.push_back(recording.ahead);
    }
    widest = std::max(widest, recording.recording.size());
    for (const PredictedChannel& channel : recording.channels) {
      widest_channel = std::max(widest_channel, channel.name.size());
    }
  }
  std::string text =
      fmt::format("{:<{}}  role        {:<{}}", "recording", widest, "channel", widest_channel);
  std::vector<std::size_t> widths;
  for (const double ahead : horizons) {
    const std::string words = prediction_words(prediction, ahead);
    widths.push_back(std::max<std::size_t>(9, words.size()));
    text += fmt::format("  {:>{}}", words, widths.back());
  }
  text += '\n';
  // Every horizon has the same recordings, in the same order.
  const std::size_t count =
      prediction.recordings.size() / std::max<std::size_t>(1, horizons.size());
  for (std::size_t i = 0; i < count; ++i) {
    const RecordingPrediction& first = prediction.recordings[i];
    for (std::size_t c = 0; c < first.channels.size(); ++c) {
      text += fmt::format("{:<{}}  {:<10}  {:<{}}", first.recording, widest, name_of(first.role),
                          first.channels[c].name, widest_channel);
      for (std::size_t h = 0; h < horizons.size(); ++h) {
        const PredictedChannel& channel = prediction.recordings[h * count + i].channels[c];
        text += fmt::format("  {:>{}}", cell(channel), widths[h]);
      }
      text += '\n';
    }
  }
  return text;
}

int execute(const Arguments& arguments, const Invocation& invocation) {
  const auto start = std::chrono::steady_clock::now();
  const Campaign campaign = read_campaign(arguments.campaign);
  if (!arguments.output.empty()) require_writable(arguments.output);
  catch_interrupts();
  const ModelPrediction prediction = predict_recordings(
      arguments.model, campaign, {arguments.physics.begin(), arguments.physics.end()},
      arguments.threads,
      arguments.initial_state == "free" ? FreeRunStart::kEstimated : FreeRunStart::kMeasured);
  if (!arguments.output.empty()) {
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    write_text_file(arguments.output,
                    prediction_page(prediction, arguments.model, campaign.file.string(),
                                    {.command = command_line(invocation.arguments),
                                     .seconds = seconds.count()}));
  }
  if (arguments.json) {
    fmt::print("{}\n", prediction_json(prediction, arguments.model, arguments.campaign).dump());
  } else {
    fmt::print("{} as the model stands, nothing fitted: {}, in %\n{}", prediction.of,
               words_of_measure(prediction), table_of(prediction));
    for (const std::string& note : prediction.notes) fmt::print("note: {}\n", note);
    if (!arguments.output.empty()) fmt::print("wrote {}\n", arguments.output);
  }
  return kDone;
}

}  // namespace

void add_predict_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("predict", "How well a model predicts recordings, as it stands");
  auto arguments = std::make_shared<Arguments>();
  add_machine_files(*command, arguments->model, arguments->campaign,
                    "graybox-lumped/1 or graybox-rigid-robot/1 (YAML)");
  command->add_option("-o,--output", arguments->output, "write one page with curves (HTML)");
  command->add_option("--physics", arguments->physics,
                      "graybox-physics/1 files with further elements");
  command
      ->add_option("--initial-state", arguments->initial_state,
                   "lumped models in free run: measured, or free (estimated from the whole "
                   "recording)")
      ->check(CLI::IsMember({"measured", "free"}))
      ->capture_default_str();
  add_threads(*command, arguments->threads);
  add_time_limit(*command, OnStop::kLosesNothing);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Exit codes: 0 predicted; 2 bad input.\n"
      "Examples:\n"
      "  graybox predict docs/examples/fit/drive/motor.yaml docs/examples/fit/drive\n"
      "  graybox predict report/model_extended.yaml campaign/ -o prediction.html\n"
      "  graybox predict drive.yaml campaign/ --initial-state free    (as models are compared)");
  command->callback([arguments, &invocation] {
    find_machine_files("predict", arguments->model, arguments->campaign);
    invocation.exit_code = execute(*arguments, invocation);
  });
}

}  // namespace graybox::cli
