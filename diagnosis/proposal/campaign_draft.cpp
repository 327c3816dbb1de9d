#include "diagnosis/proposal/campaign_draft.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "diagnosis/log_columns/even_samples.hpp"
#include "diagnosis/log_columns/motion_span.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

constexpr double kShareOfFit = 0.5, kMostOfFit = 0.75;
constexpr double kWorthCutting = 0.02;  // of a recording

std::string behind(const std::string& line, const std::string& comment) {
  if (comment.empty()) return line + "\n";
  const std::string sign = comment.starts_with("#") ? "" : "# ";
  return fmt::format("{:<46} {}{}\n", line, sign, comment);
}

// A column that readers would take for the time by its name, and that is not to be used.
std::string ignored_time(const std::vector<LogRecording>& recordings) {
  const std::string usual = TimeColumn().column;
  for (const LogColumn& column : recordings.front().columns) {
    if (column.name == usual) return behind("time: ignore", "'" + usual + "' is not used");
  }
  return "";
}

std::string time_text(const LogTime& time, const std::vector<LogRecording>& recordings) {
  const bool is_open = time.sample_time <= 0.0;
  if (is_open && time.column.empty()) {
    return behind("sample_time: ANSWER",
                  "# ANSWER: how many seconds lie between samples? No column has the time.");
  }
  std::string text;
  if (is_open) {
    text = "sample_time: irregular\n";
  } else if (time.is_even) {
    text = behind(fmt::format("sample_time: {:g}", time.sample_time), "s");
  } else {
    text = behind("sample_time: irregular", "resampled below");
  }
  if (time.column.empty()) return text + ignored_time(recordings);
  std::string more = time.factor == 1.0 ? "" : fmt::format(", factor: {:.10g}", time.factor);
  if (time.burst >= 0.0 && !is_open) {
    more += fmt::format(", burst: {:.3g}", time.burst * time.seconds());
  }
  const std::string line = fmt::format("time: {{column: {}, unit: {}{}}}", in_quotes(time.column),
                                       is_open ? "ANSWER" : time.unit, more);
  return text + behind(line, is_open
                                 ? fmt::format("# ANSWER: which unit have steps of {:g}: s, ms, "
                                               "us or ns?",
                                               time.median_step)
                                 : time.why);
}

// What one recorded number is in a unit with a factor, "[0.1 deg]"; else empty.
std::string gain_of_factor(const DraftChannel& channel, const LogRecording& recording) {
  if (!channel.gain.empty() || channel.column == "ANSWER") return "";
  const double factor = recording.at(channel.file, channel.column).words.unit_factor;
  const Unit* unit = find_unit(channel.unit);
  if (factor == 1.0 || unit == nullptr) return "";
  const auto in_brackets = [](std::string_view part) {
    return part.find('/') == std::string_view::npos ? std::string(part) : fmt::format("({})", part);
  };
  return fmt::format("{{value: {:.8g}, unit: {}/{}}}", factor * unit->factor,
                     in_brackets(unit->base), in_brackets(channel.unit));
}

// Its whole title where the user's unit replaces the file's (is_whole_title).
std::string named_column(const DraftChannel& channel, const LogRecording& recording) {
  if (channel.column == "ANSWER") return channel.column;
  const LogColumn& column = recording.at(channel.file, channel.column);
  const bool is_replaced = column.answered && !column.stated_unit.empty() &&
                           find_unit(channel.unit) != nullptr &&
                           !is_same_unit(column.stated_unit, channel.unit);
  return is_replaced ? fmt::format("{} [{}]", column.name, column.stated_unit) : column.name;
}

std::string channel_text(const DraftChannel& channel, const LogRecording& recording) {
  std::string line = fmt::format("  - {{name: {}, ", channel.name);
  const std::string key = recording.keys[channel.file];
  if (!key.empty()) line += fmt::format("file: {}, ", key);
  line += fmt::format(
      "column: {}, unit: {}, ", in_quotes(named_column(channel, recording)),
      channel.unit == "1" || channel.unit == "%" ? in_quotes(channel.unit) : channel.unit);
  const std::string factor = gain_of_factor(channel, recording);
  if (!channel.gain.empty()) line += fmt::format("gain: {}, ", channel.gain);
  if (!factor.empty()) line += fmt::format("gain: {}, ", factor);
  return behind(line + fmt::format("is: {}}}", channel.is), channel.comment);
}

std::string preprocess_text(const CampaignDraft& draft) {
  std::string text;
  if (!draft.gapped.empty()) {
    text += behind(fmt::format("  - {{kind: valid, of: [{}]}}", fmt::join(draft.gapped, ", ")),
                   "rows without a number are left out");
  }
  for (const DraftWrap& wrap : draft.wrapped) {
    text += behind(fmt::format("  - {{kind: unwrap, of: [{}]{}}}", wrap.channel, wrap.period),
                   wrap.period.empty() ? "jumps by whole turns" : "jumps by whole periods");
  }
  if (!draft.time.is_even) {
    text += behind(fmt::format("  - {{kind: resample, sample_time: {:g}}}", draft.time.sample_time),
                   draft.time.of_step);
  }
  if (draft.low_pass) {
    text += behind(fmt::format("  - {{kind: low_pass, frequency: {:g}}}", *draft.low_pass),
                   "Hz; " + draft.low_pass_reason);
  }
  if (draft.decimation > 1) {
    text += behind(fmt::format("  - {{kind: decimate, factor: {}}}", draft.decimation),
                   draft.decimation_reason);
  }
  for (const std::string& each : draft.computed) text += each;
  return text.empty() ? text : "preprocess:\n" + text;
}

// 1 or -1: all of the motion goes that way; 0: it goes both ways, or not at all.
int way_of(const Eigen::VectorXd& motion, bool is_velocity) {
  constexpr double kBack = 0.02, kJump = 10.0;  // of the squares; of a median step
  const Eigen::Index n = motion.size(), over = std::max<Eigen::Index>(1, n / 100);
  if (n <= 2 * over) return 0;
  Eigen::ArrayXd rate = motion.array().tail(n - over);
  if (!is_velocity) rate -= motion.array().head(n - over);
  std::vector<double> sizes(static_cast<std::size_t>(rate.size()));
  std::ranges::transform(rate, sizes.begin(), [](double each) { return std::abs(each); });
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::ranges::nth_element(sizes, middle);
  rate = rate.max(-kJump * *middle).min(kJump * *middle);  // an angle that wraps jumps back
  const double forwards = rate.max(0.0).square().sum(), backwards = rate.min(0.0).square().sum();
  if (!(forwards + backwards > 0.0)) return 0;
  if (std::min(forwards, backwards) > kBack * (forwards + backwards)) return 0;
  return forwards > backwards ? 1 : -1;
}

// Bits: 1 forwards, 2 backwards, of all that moves in a recording; 0 where it stands.
int ways_in(const DraftExperiment& each, const std::vector<LogRecording>& recordings,
            const std::vector<const LogColumn*>& columns, bool are_velocities) {
  int ways = 0;
  for (const LogColumn* column : columns) {
    if (column == nullptr) continue;
    const LogColumn& here = recordings[each.recording].at(column->file, column->name);
    if (here.values.maxCoeff() <= here.values.minCoeff()) continue;
    const int way = way_of(without_gaps(here.values).segment(each.first, each.last - each.first),
                           are_velocities);
    ways |= way > 0 ? 1 : way < 0 ? 2 : 3;
  }
  return ways;
}

// The last recording whose loss leaves the fit all ways that the recordings go; else the last.
std::size_t kept_out_of(const std::vector<DraftExperiment>& experiments,
                        const std::vector<LogRecording>& recordings,
                        const std::vector<const LogColumn*>& columns, bool are_velocities) {
  const std::size_t last = experiments.size() - 1;
  if (experiments.size() < 3) return last;
  std::vector<int> ways;
  for (const DraftExperiment& each : experiments) {
    ways.push_back(ways_in(each, recordings, columns, are_velocities));
  }
  const auto without = [&](std::size_t left_out) {
    int all = 0;
    for (std::size_t k = 0; k < ways.size(); ++k) all |= k == left_out ? 0 : ways[k];
    return all;
  };
  const int all = without(experiments.size());
  for (std::size_t k = experiments.size(); k-- > 0;) {
    if (ways[k] != 0 && without(k) == all) return k;
  }
  return last;
}

// Whether each motion goes one way in the fit, and the other way in what is kept out: then dry
// friction is a constant in both, and what was fitted fails on what was kept out.
bool go_opposite_ways(const std::vector<DraftExperiment>& experiments,
                      const std::vector<LogRecording>& recordings,
                      const std::vector<const LogColumn*>& columns, bool are_velocities) {
  bool any = false;
  for (const LogColumn* column : columns) {
    if (column == nullptr) return false;
    int fitted = 0;
    for (const DraftExperiment& each : experiments) {
      const LogColumn& here = recordings[each.recording].at(column->file, column->name);
      if (!here.moves()) continue;
      const int way = way_of(without_gaps(here.values).segment(each.first, each.last - each.first),
                             are_velocities);
      if (way == 0 || (!each.is_validation && fitted == -way)) return false;
      if (each.is_validation && fitted != -way) return false;
      any = any || each.is_validation;
      fitted = each.is_validation ? fitted : way;
    }
  }
  return any;
}

// Every second part of each recording is kept out, of the last ones those that are fitted of the
// first ones; empty where parts would be too short.
std::vector<DraftExperiment> shared_out(const std::vector<DraftExperiment>& experiments) {
  constexpr Eigen::Index kFewestOfPart = 80;
  std::vector<DraftExperiment> parts;
  for (const DraftExperiment& each : experiments) {
    const Eigen::Index samples = each.last - each.first + 1;
    const Eigen::Index count = samples >= 4 * kFewestOfPart ? 4 : 2;
    if (samples < count * kFewestOfPart) return {};
    for (Eigen::Index k = 0; k < count; ++k) {
      parts.push_back({each.recording, each.first + k * samples / count,
                       each.first + (k + 1) * samples / count - 1, false,
                       (k % 2 == 1) != each.is_validation});
    }
  }
  return parts;
}

// The files that channels read, by key.
std::string files_text(const CampaignDraft& draft, const LogRecording& recording,
                       const std::filesystem::path& folder) {
  const auto name = [&](std::size_t file) {
    std::filesystem::path path = recording.files[file];
    if (path.is_relative()) {
      const std::filesystem::path base = folder.empty() ? std::filesystem::path(".") : folder;
      path = std::filesystem::proximate(path, base);
    }
    return in_quotes(path.string());
  };
  if (recording.files.size() == 1) return "file: " + name(0);
  std::set<std::size_t> used;
  for (const DraftChannel& channel : draft.channels) used.insert(channel.file);
  std::string text;
  for (const std::size_t file : used) {
    text += fmt::format("{}{}: {}", text.empty() ? "" : ", ", recording.keys[file], name(file));
  }
  return "files: {" + text + "}";
}

// Whether the experiments of a recording begin behind its first sample, or end before its last.
bool leaves_out_ends(const CampaignDraft& draft, std::size_t place, const LogRecording& recording) {
  Eigen::Index first = recording.samples(), last = 0;
  for (const DraftExperiment& each : draft.experiments) {
    if (each.recording != place) continue;
    first = std::min(first, each.first);
    last = std::max(last, each.last);
  }
  return first > 0 || last + 1 < recording.samples();
}

std::string experiments_text(const CampaignDraft& draft,
                             const std::vector<LogRecording>& recordings,
                             const std::filesystem::path& folder) {
  std::string text = "experiments:\n";
  for (const DraftExperiment& each : draft.experiments) {
    const LogRecording& recording = recordings[each.recording];
    text += "  - " + files_text(draft, recording, folder) + "\n";
    if (!each.is_whole || recording.is_part) {
      text += behind(fmt::format("    segments: [[{}, {}]]", recording.file_row(each.first),
                                 recording.file_row(each.last)),
                     leaves_out_ends(draft, each.recording, recording)
                         ? "samples, from 0; standstill at the ends is left out"
                         : "samples, from 0");
    }
    if (draft.time.every > 1 && draft.decimation == 1) {
      text +=
          behind(fmt::format("    every: {{samples: {}, from: {}}}", draft.time.every, each.from),
                 "each value is held so long");
    }
    if (each.is_validation) text += behind("    role: validation", "kept out of the fit");
  }
  return text;
}

}  // namespace

std::string in_quotes(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string campaign_text(const CampaignDraft& draft, const std::vector<LogRecording>& recordings,
                          const std::filesystem::path& folder) {
  std::string text =
      draft.heading + "format: graybox-campaign/1\n" + time_text(draft.time, recordings);
  text += "channels:\n";
  for (const DraftChannel& channel : draft.channels) {
    text += channel_text(channel, recordings.front());
  }
  const char* usual =
      draft.hold == "zero" ? "a controller holds its output between samples" : "uneven times";
  text += behind("hold: " + draft.hold, draft.hold_reason.empty() ? usual : draft.hold_reason);
  text += preprocess_text(draft) + experiments_text(draft, recordings, folder);
  if (!draft.unused.empty()) text += "# Not used:\n";
  for (const std::string& each : draft.unused) text += "#   " + each + "\n";
  return text;
}

std::vector<DraftExperiment> draft_experiments(const std::vector<LogRecording>& recordings,
                                               const std::vector<const LogColumn*>& columns,
                                               bool are_velocities, double sample_time,
                                               SplitPlan plan) {
  std::vector<DraftExperiment> experiments;
  const double step = sample_time > 0.0 ? sample_time : 1.0;
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    std::vector<Eigen::VectorXd> motions;
    for (const LogColumn* column : columns) {
      motions.push_back(recordings[k].at(column->file, column->name).values);
    }
    const Eigen::Index last = recordings[k].samples() - 1;
    MotionSpan span{0, last};
    if (!motions.empty() && plan == SplitPlan::kMovingHalves) {
      span = motion_span(motions, are_velocities, step);
    }
    const auto rest = static_cast<double>(last - (span.last - span.first));
    if (rest < kWorthCutting * static_cast<double>(last)) span = {0, last};
    experiments.push_back({k, span.first, span.last, span.first == 0 && span.last == last, false});
  }
  if (plan == SplitPlan::kNoValidation) return experiments;
  if (experiments.size() > 1) {
    experiments[kept_out_of(experiments, recordings, columns, are_velocities)].is_validation = true;
    if (plan == SplitPlan::kMostInFit ||
        !go_opposite_ways(experiments, recordings, columns, are_velocities)) {
      return experiments;
    }
    const std::vector<DraftExperiment> parts = shared_out(experiments);
    return parts.empty() ? experiments : parts;
  }
  const double share = plan == SplitPlan::kMostInFit ? kMostOfFit : kShareOfFit;
  DraftExperiment whole = experiments.front();
  const auto count = static_cast<double>(whole.last - whole.first);
  const Eigen::Index cut = whole.first + static_cast<Eigen::Index>(share * count);
  return {{0, whole.first, cut, false, false}, {0, cut + 1, whole.last, false, true}};
}

}  // namespace graybox
