// `graybox recordings`: what a campaign holds and whether it can be used.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/arguments/time_limit_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/proposal/proposal.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"
#include "problems/files/atomic_file.hpp"

namespace graybox::cli {
namespace {

using Json = nlohmann::ordered_json;

struct RecordingsArguments {
  std::vector<std::string> files;  // one campaign, or logs for a template
  std::string output;
  bool json = false, from_logs = false, units = false;
};

const char* name_of_severity(Severity severity) {
  return severity == Severity::kError ? "error" : "warning";
}

Json json_of(const std::vector<Finding>& findings) {
  Json list = Json::array();
  for (const Finding& finding : findings) {
    Json entry{{"severity", name_of_severity(finding.severity)},
               {"check", finding.check},
               {"message", finding.message}};
    if (!finding.channel.empty()) entry["channel"] = finding.channel;
    if (finding.time) entry["time"] = *finding.time;
    if (finding.strength > 0.0) entry["strength"] = finding.strength;
    if (!finding.otherwise.empty()) entry["could_also_be"] = finding.otherwise;
    if (!finding.mend.empty()) entry["mend"] = finding.mend;
    list.push_back(std::move(entry));
  }
  return list;
}

Json json_of(const Experiment& experiment, const ExperimentRecording& recording) {
  std::size_t used = 0;
  for (const SignalPiece& piece : recording.data.pieces) {
    used += static_cast<std::size_t>(piece.time.size());
  }
  return {{"name", experiment.name},
          {"role", name_of(experiment.role)},
          {"samples", recording.samples},
          {"segments", recording.data.pieces.size()},
          {"used_samples", used},
          {"duration", recording.duration},
          {"periodic", experiment.excitation.has_value()},
          {"sound", recording.sound()},
          {"findings", json_of(recording.findings)}};
}

Json channel_list(const std::vector<Signal>& signals) {
  Json list = Json::array();
  for (const Signal& signal : signals) {
    list.push_back({{"name", signal.name}, {"unit", signal.unit}, {"is", name_of(signal.role)}});
  }
  return list;
}

std::size_t count_of(const Json& summary, const char* severity) {
  const auto count = [&](const Json& findings) {
    return std::ranges::count_if(findings,
                                 [&](const Json& f) { return f["severity"] == severity; });
  };
  std::ptrdiff_t total = count(summary["findings"]);
  for (const Json& experiment : summary["experiments"]) total += count(experiment["findings"]);
  return static_cast<std::size_t>(total);
}

// False once the user has asked to stop.
bool examine(const Campaign& campaign, Json& summary) {
  catch_interrupts(OnStop::kLosesNothing);
  CountProgress progress("experiment", campaign.experiments.size());
  std::vector<Signal> signals;
  Json sample_time = nullptr;
  CopyFinder copies;
  for (std::size_t k = 0; k < campaign.experiments.size(); ++k) {
    ExperimentRecording recording = examine_experiment(campaign, k, MotionPairs::kCompared);
    copies.examine(campaign.experiments[k], recording);
    if (recording.sound()) {
      signals = recording.data.signals;
      if (recording.data.sample_time) sample_time = *recording.data.sample_time;
    }
    summary["experiments"].push_back(json_of(campaign.experiments[k], recording));
    if (!progress.update(k + 1)) return false;
  }
  summary["channels"] = channel_list(signals);
  summary["sample_time"] = sample_time;
  return true;
}

Json summarise(const Campaign& campaign, bool& complete) {
  Json summary{
      {"campaign", campaign.file.string()}, {"model", campaign.model},
      {"recorded_sample_time", nullptr},    {"sample_time", nullptr},
      {"channels", Json::array()},          {"findings", json_of(examine_campaign(campaign))},
      {"experiments", Json::array()}};
  if (campaign.sample_time) summary["recorded_sample_time"] = *campaign.sample_time;
  complete = examine(campaign, summary);
  summary["warnings"] = count_of(summary, "warning");
  summary["errors"] = count_of(summary, "error");
  return summary;
}

std::string text_of_findings(const Json& findings) {
  std::string text;
  for (const Json& finding : findings) {
    text += fmt::format("    {}: {}\n", finding["severity"].get<std::string>(),
                        finding["message"].get<std::string>());
  }
  return text;
}

std::string text_of_channels(const Json& channels) {
  std::string text;
  for (const char* role : {"input", "output", "reference", "other"}) {
    std::string names;
    for (const Json& channel : channels) {
      if (channel["is"] != role) continue;
      names += fmt::format("{}{} [{}]", names.empty() ? "" : ", ",
                           channel["name"].get<std::string>(), channel["unit"].get<std::string>());
    }
    if (!names.empty()) text += fmt::format("  {:<10} {}\n", role, names);
  }
  return text;
}

// The samples used, and the file's. Resampled ones may be more than the rows that they come from.
std::string words_of_samples(const Json& experiment, bool is_resampled) {
  const auto used = experiment["used_samples"].get<std::size_t>(),
             rows = experiment["samples"].get<std::size_t>();
  return is_resampled ? fmt::format("{} samples, resampled from a file of {} rows,", used, rows)
                      : fmt::format("{} of {} samples", used, rows);
}

std::string text_of(const Json& summary) {
  const Json& experiments = summary["experiments"];
  std::string text = fmt::format("{}: {} experiment{}, ", summary["campaign"].get<std::string>(),
                                 experiments.size(), experiments.size() == 1 ? "" : "s");
  text +=
      summary["recorded_sample_time"].is_null()
          ? std::string("irregular samples\n")
          : fmt::format("samples every {:g} s\n", summary["recorded_sample_time"].get<double>());
  if (summary["sample_time"] != summary["recorded_sample_time"] &&
      !summary["sample_time"].is_null()) {
    text += fmt::format("  preprocessed to samples every {:g} s\n",
                        summary["sample_time"].get<double>());
  }
  text += text_of_channels(summary["channels"]) + text_of_findings(summary["findings"]);
  const bool is_resampled =
      summary["recorded_sample_time"].is_null() && !summary["sample_time"].is_null();
  for (const Json& experiment : experiments) {
    text += fmt::format("  {} ({}): ", experiment["name"].get<std::string>(),
                        experiment["role"].get<std::string>());
    text += experiment["sound"].get<bool>()
                ? fmt::format("{} in {} segment{}, {:.4g} s{}\n",
                              words_of_samples(experiment, is_resampled),
                              experiment["segments"].get<std::size_t>(),
                              experiment["segments"].get<std::size_t>() == 1 ? "" : "s",
                              experiment["duration"].get<double>(),
                              experiment["periodic"].get<bool>() ? ", periodic" : "")
                : std::string("can't be used\n");
    text += text_of_findings(experiment["findings"]);
  }
  text += fmt::format("{} errors, {} warnings\n", summary["errors"].get<std::size_t>(),
                      summary["warnings"].get<std::size_t>());
  return text;
}

// A campaign.yaml for logs, printed or written.
int propose(const RecordingsArguments& arguments) {
  ProposalRequest request;
  request.machine = ProposedMachine::kRecordings;
  request.command = "graybox recordings --template";
  for (const std::string& file : arguments.files) {
    request.logs.emplace_back(file);
    request.command += " " + file;
  }
  request.folder = std::filesystem::path(arguments.output).parent_path();
  const ModelProposal proposal = propose_model(request);
  if (arguments.output.empty()) {
    fmt::print("{}", proposal.campaign_text);
  } else {
    if (std::filesystem::exists(arguments.output)) {
      throw InputError(arguments.output + ": is there already; choose another file by -o");
    }
    write_text_file(arguments.output, proposal.campaign_text);
  }
  return proposal.questions.empty() ? kDone : kBadInput;
}

// The units that campaigns may state: what one of each is in the unit of its kind.
int list_units(bool as_json) {
  Json list = Json::array();
  std::string text;
  for (const Unit& unit : known_units()) {
    list.push_back({{"unit", unit.name}, {"factor", unit.factor}, {"base", unit.base}});
    text += fmt::format("{:<8} {:.10g} {}\n", unit.name, unit.factor, unit.base);
  }
  fmt::print("{}", as_json ? list.dump() + "\n" : text);
  return kDone;
}

int execute(const RecordingsArguments& arguments) {
  if (arguments.units) return list_units(arguments.json);
  if (arguments.files.empty())
    throw InputError("campaign is required; see graybox recordings --help");
  if (arguments.from_logs) return propose(arguments);
  if (arguments.files.size() > 1) {
    throw InputError(arguments.files[1] + ": one campaign at a time; of logs say --template");
  }
  const Campaign campaign = read_campaign(arguments.files.front());
  bool complete = true;
  const Json summary = summarise(campaign, complete);
  if (!complete) {
    fmt::print(stderr, "graybox: interrupted\n");
    return kShort;
  }
  if (!arguments.output.empty()) write_text_file(arguments.output, summary.dump(2) + "\n");
  fmt::print("{}", arguments.json ? summary.dump() + "\n" : text_of(summary));
  return summary["errors"].get<std::size_t>() == 0 ? kDone : kBadInput;
}

}  // namespace

void add_recordings_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("recordings", "Read and check the recordings of a campaign");
  auto arguments = std::make_shared<RecordingsArguments>();
  command->add_option("campaign", arguments->files,
                      "graybox-campaign/1 file (YAML), or the folder of a campaign.yaml; with "
                      "--template: logs");
  command->add_option("-o,--output", arguments->output, "write the summary to this file (JSON)");
  command->add_flag("--template", arguments->from_logs,
                    "propose a campaign.yaml for logs (print it, or -o)");
  command->add_flag("--units", arguments->units, "list the units that a campaign may state");
  add_time_limit(*command, OnStop::kLosesNothing);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Exit codes: 0 usable, perhaps with warnings; 2 a recording can't be used, and why.\n"
      "Examples:\n"
      "  graybox recordings campaign/\n"
      "  graybox recordings diagnosis/campaigns/emps.yaml --json\n"
      "  graybox recordings --template log.csv -o campaign.yaml\n"
      "  graybox recordings --units");
  command->callback([arguments, &invocation] { invocation.exit_code = execute(*arguments); });
}

}  // namespace graybox::cli
