#include "diagnosis/runs/recording_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "diagnosis/log_columns/column_words.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "problems/base/stop.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

// The rest is counted in a line.
void keep_first(const Campaign& campaign, std::vector<std::string>& warnings) {
  constexpr std::size_t kMost = 12;
  if (warnings.size() <= kMost) return;
  const std::size_t more = warnings.size() - kMost;
  warnings.resize(kMost);
  warnings.push_back(
      fmt::format("{} more; 'graybox recordings {}' lists all", more, campaign.file.string()));
}

// The goal of a position servo, which pulls by a spring: its crests are those of the motion that is
// wanted, and no end of a drive. Counts are those of a goal where the title says what is wanted.
bool is_goal(const Channel& channel) {
  const Unit* recorded = find_unit(channel.recorded_unit);
  if (recorded == nullptr) return false;
  if (recorded->base == "rad" || recorded->base == "m") return true;
  const ColumnWords title = read_column_words(channel.column, "");
  return recorded->base == "counts" && title.is_reference && !drives(title.quantity);
}

void note_clipped(const Campaign& campaign, const std::vector<Finding>& findings,
                  std::vector<std::string>& clipped) {
  for (const Channel& channel : campaign.channels) {
    if (channel.role != ChannelRole::kInput || channel.range || is_goal(channel)) continue;
    const bool is_clipped = std::ranges::any_of(findings, [&](const Finding& finding) {
      return finding.check == "clipped" && finding.channel == channel.name;
    });
    if (is_clipped && std::ranges::count(clipped, channel.name) == 0) {
      clipped.push_back(channel.name);
    }
  }
}

}  // namespace

ExaminedRecordings examine_recordings(const Campaign& campaign) {
  ExaminedRecordings examined;
  std::vector<std::string>& warnings = examined.warnings;
  CopyFinder copies;
  for (const Finding& finding : examine_campaign(campaign)) warnings.push_back(finding.message);
  std::size_t unread = 0;
  for (std::size_t i = 0; i < campaign.experiments.size(); ++i) {
    const Experiment& experiment = campaign.experiments[i];
    examined.files.push_back({experiment.name, name_of(experiment.role)});
    if (stop_requested()) {
      ++unread;
      continue;
    }
    ExperimentRecording recording = load_experiment(campaign, i);
    copies.examine(experiment, recording);
    examined.files.back().samples = recording.samples;
    note_clipped(campaign, recording.findings, examined.clipped);
    for (const Finding& finding : recording.findings) {  // of two parts of a file said once
      if (std::ranges::find(warnings, finding.message) != warnings.end()) continue;
      warnings.push_back(finding.message);
    }
  }
  keep_first(campaign, warnings);
  if (unread > 0) {
    warnings.push_back(fmt::format(
        "{} of {} were not looked at for faults: there was no time; 'graybox recordings "
        "{}' does",
        unread, campaign.experiments.size(), campaign.file.string()));
  }
  return examined;
}

std::vector<std::string> warnings_of_loads(const Campaign& campaign) {
  const bool has_load = std::ranges::any_of(
      campaign.experiments, [](const Experiment& each) { return !each.load.empty(); });
  if (!has_load) return {};
  return {
      "load: models of masses know no loads, so all recordings were taken for one machine: "
      "state it as a robot of one joint (graybox-rigid-robot/1), or diagnose those with a load "
      "by themselves"};
}

}  // namespace graybox
