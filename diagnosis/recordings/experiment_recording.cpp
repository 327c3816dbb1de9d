#include "diagnosis/recordings/experiment_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recording_files/written_unit.hpp"
#include "diagnosis/recordings/data_faults.hpp"
#include "diagnosis/recordings/fault_mending.hpp"
#include "diagnosis/recordings/motion_pairs.hpp"
#include "diagnosis/recordings/signal_checks.hpp"
#include "diagnosis/signal_faults/time_axis.hpp"
#include "diagnosis/signal_faults/written_bursts.hpp"
#include "diagnosis/signal_faults/wrong_stamp.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;
using FilesByKey = std::map<std::string, RecordingFile>;

constexpr double kSampleTimeAgreement = 1e-6;  // relative
constexpr double kTimesAgreement = 0.01;       // of a step, among files of one experiment

void add_error(ExperimentRecording& recording, const char* check, const std::string& text) {
  recording.findings.push_back({Severity::kError, check, text});
}
void add_warning(ExperimentRecording& recording, const char* check, const std::string& text) {
  recording.findings.push_back({Severity::kWarning, check, text});
}

// ---- columns ------------------------------------------------------------------------------------

struct ChannelColumn {
  const Channel* channel;
  const RecordedColumn* column;
  const RecordingFile* file;
};

std::vector<ChannelColumn> channel_columns(const Campaign& campaign, const FilesByKey& files) {
  std::vector<ChannelColumn> columns;
  for (const Channel& channel : campaign.channels) {
    const RecordingFile& file = files.at(channel.file);
    columns.push_back({&channel, &file.at(channel.column), &file});
  }
  return columns;
}

// False, with findings, if the columns don't belong together.
bool equal_lengths(const std::vector<ChannelColumn>& columns, ExperimentRecording& recording) {
  const ChannelColumn& first = columns.front();
  for (const ChannelColumn& other : columns) {
    if (other.column->values.size() == first.column->values.size()) continue;
    add_error(recording, "length",
              fmt::format("{}: {} has {} samples, but {} has {}; channels of one experiment share "
                          "one sample rate",
                          other.file->path, other.channel->name, other.column->values.size(),
                          first.channel->name, first.column->values.size()));
    return false;
  }
  return true;
}

// Whether the file's unit is the channel's, or one with a factor ("0.1 deg") that its gain has.
bool is_unit_of_channel(const std::string& stated, const Channel& channel) {
  if (is_same_unit(stated, channel.recorded_unit)) return true;
  if (stated == "Hz" && channel.recorded_unit == "turn/s") return true;
  const WrittenUnit written = written_unit(stated);
  if (written.unit != channel.recorded_unit) return false;
  constexpr double kRounding = 1e-6;
  const double factor = written.factor * find_unit(written.unit)->factor;
  return std::abs(channel.factor - factor) <= kRounding * std::abs(factor);
}

void check_stated_units(const std::vector<ChannelColumn>& columns, ExperimentRecording& recording) {
  for (const auto& [channel, column, file] : columns) {
    if (column->unit.empty() || is_unit_of_channel(column->unit, *channel)) {
      continue;
    }
    // Who names the column by its whole title has seen the unit, and says that it is another.
    if (is_whole_title(channel->column, column->name, column->unit)) {
      add_warning(recording, "unit",
                  fmt::format("{}: {} is titled in {}, and taken as {}, as the campaign says",
                              file->path, column->name, column->unit, channel->recorded_unit));
      continue;
    }
    add_error(recording, "unit",
              fmt::format("{}: {} is in {}, but the campaign says {}; where the title is wrong, "
                          "say column: \"{} [{}]\"",
                          file->path, column->name, column->unit, channel->recorded_unit,
                          column->name, column->unit));
  }
}

// ---- time ---------------------------------------------------------------------------------------

// Seconds that one of the column's unit is: the campaign's word, or else the file's.
double time_factor(const Campaign& campaign, const RecordedColumn& column) {
  if (campaign.time.has_unit) return campaign.time.factor;
  const WrittenUnit written = written_unit(column.unit);
  const Unit* unit = find_unit(written.unit);
  return unit != nullptr && unit->base == "s" ? written.factor * unit->factor : 1.0;
}

// Seconds, from the first file that has the column; empty if none has.
Eigen::VectorXd recorded_times(const Campaign& campaign, const FilesByKey& files, Index samples,
                               ExperimentRecording& recording) {
  Eigen::VectorXd times;
  if (campaign.time.column.empty()) return times;
  const RecordingFile* first = nullptr;
  for (const auto& [key, file] : files) {
    const RecordedColumn* column = file.find(campaign.time.column);
    if (column == nullptr) continue;
    if (column->values.size() != samples) {
      add_error(recording, "time",
                fmt::format("{}: {} has {} samples, the channels have {}", file.path, column->name,
                            column->values.size(), samples));
      continue;
    }
    const Eigen::VectorXd here = time_factor(campaign, *column) * column->values;
    if (first == nullptr) {
      times = here;
      first = &file;
    } else if (const double step = (times(samples - 1) - times(0)) / static_cast<double>(samples);
               !((here - times).cwiseAbs().maxCoeff() <= kTimesAgreement * step)) {
      add_error(recording, "time",
                fmt::format("{}: samples were taken at other times than in {}; they can't be put "
                            "side by side",
                            file.path, first->path));
    }
  }
  if (first == nullptr && campaign.time.required) {
    (void)files.begin()->second.at(campaign.time.column);  // says which columns there are
  }
  return times;
}

// Single stamps that the clock contradicts before and behind them.
void mend_wrong_stamps(const Campaign& campaign, const Experiment& experiment,
                       Eigen::VectorXd& times, ExperimentRecording& recording) {
  if (!campaign.mends_faulty_samples) return;
  const std::vector<WrongStamp> wrong = mend_stamps(times);
  if (wrong.empty()) return;
  add_warning(recording, "time",
              fmt::format("{}: time stamp of sample {}: {} s", experiment.name,
                          wrong.front().sample, words_of_stamps(wrong)));
}

// A row that is the sample of the row beside it, logged twice, has no time of its own. Where
// samples are said to be even, no time is read.
void forget_repeated_rows(const Campaign& campaign, const std::vector<ChannelColumn>& columns,
                          Eigen::VectorXd& times) {
  if (campaign.sample_time) return;
  std::vector<Eigen::VectorXd> values;
  for (const ChannelColumn& each : columns) values.push_back(each.column->values);
  for (const Index row : repeated_rows(times, values)) {
    times(row) = std::numeric_limits<double>::quiet_NaN();
  }
}

void check_stated_sample_times(const Campaign& campaign, const FilesByKey& files,
                               ExperimentRecording& recording) {
  if (!campaign.sample_time) return;
  for (const auto& [key, file] : files) {
    if (!file.sample_time || std::abs(*file.sample_time - *campaign.sample_time) <=
                                 kSampleTimeAgreement * *campaign.sample_time) {
      continue;
    }
    add_error(recording, "time",
              fmt::format("{}: states a sample time of {:g} s, but the campaign says {:g} s",
                          file.path, *file.sample_time, *campaign.sample_time));
  }
}

// ---- pieces -------------------------------------------------------------------------------------

// The segments, or all samples; empty with a finding if one lies outside.
std::vector<Segment> used_segments(const Experiment& experiment, std::size_t samples,
                                   ExperimentRecording& recording) {
  if (experiment.segments.empty()) return {{0, samples - 1}};
  for (const Segment& segment : experiment.segments) {
    if (segment.last < samples) continue;
    add_error(recording, "segment",
              fmt::format("{}: segment [{}, {}] ends beyond the last sample, {}", experiment.name,
                          segment.first, segment.last, samples - 1));
    return {};
  }
  return experiment.segments;
}

void check_period(const Experiment& experiment, const Segment& segment,
                  ExperimentRecording& recording) {
  if (!experiment.excitation) return;
  const std::size_t samples = segment.last - segment.first + 1;
  const std::size_t needed = experiment.excitation->period * experiment.excitation->periods;
  if (samples < needed) {
    add_error(recording, "period",
              fmt::format("{}: {} samples, but {} periods of {} need {}", experiment.name, samples,
                          experiment.excitation->periods, experiment.excitation->period, needed));
  } else if (samples > needed) {
    add_warning(recording, "period",
                fmt::format("{}: {} samples beyond the {} periods", experiment.name,
                            samples - needed, experiment.excitation->periods));
  }
}

// Rows from, from + every, ...
void thin(const Experiment& experiment, SignalPiece& piece) {
  if (experiment.every == 1) return;
  const auto every = static_cast<Index>(experiment.every);
  const auto from = std::min(static_cast<Index>(experiment.from), piece.time.size() - 1);
  const auto rows = Eigen::seq(from, Eigen::last, every);
  piece.first_sample += static_cast<std::size_t>(from);
  piece.time = piece.time(rows).eval();
  piece.values = piece.values(rows, Eigen::all).eval();
}

// Leaves out rows without a time, which tell nothing, and rows that a logger wrote again within a
// burst, which are no samples of their own. Gives their number.
Index leave_out_rows(const TimeColumn& time, SignalPiece& piece) {
  const std::vector<Index> kept = rows_of_samples(piece.time, time.burst);
  const Index left_out = piece.time.size() - static_cast<Index>(kept.size());
  if (left_out == 0 || kept.size() < 2) return 0;
  piece.first_sample += static_cast<std::size_t>(kept.front());
  piece.time = piece.time(kept).eval();
  piece.values = piece.values(kept, Eigen::all).eval();
  return left_out;
}

// In recorded units.
SignalPiece piece_of(const Campaign& campaign, const std::vector<ChannelColumn>& columns,
                     const Eigen::VectorXd& times, const Segment& segment) {
  const auto first = static_cast<Index>(segment.first);
  const auto size = static_cast<Index>(segment.last - segment.first + 1);
  SignalPiece piece{.first_sample = segment.first, .time = {}, .values = {}};
  if (campaign.sample_time) {
    piece.time =
        *campaign.sample_time * Eigen::VectorXd::LinSpaced(size, static_cast<double>(segment.first),
                                                           static_cast<double>(segment.last));
  } else {
    piece.time = times.segment(first, size);
  }
  piece.values.resize(size, static_cast<Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    // A zero that is written as -0 is none but zero.
    piece.values.col(static_cast<Index>(k)) =
        columns[k].column->values.segment(first, size).array() + 0.0;
  }
  return piece;
}

// The campaign's steps in the order in which checks stand between them: what mends recorded
// numbers, what mends channels in their place, and the rest.
struct StepGroups {
  std::vector<PreprocessStep> of_numbers, of_channels, others;
};

bool mends_channels(const PreprocessStep& step) {
  return std::holds_alternative<Resample>(step) || std::holds_alternative<Scale>(step) ||
         std::holds_alternative<Advance>(step);
}

StepGroups step_groups(const std::vector<PreprocessStep>& steps) {
  const auto numbers = std::ranges::find_if_not(steps, mends_recorded);
  const auto channels = std::find_if_not(numbers, steps.end(), mends_channels);
  return {{steps.begin(), numbers}, {numbers, channels}, {channels, steps.end()}};
}

// As recorded; empty with findings if times are no times.
void read_pieces(const Campaign& campaign, const Experiment& experiment,
                 const std::vector<ChannelColumn>& columns, const Eigen::VectorXd& times,
                 ExperimentRecording& recording) {
  for (const Segment& segment : used_segments(experiment, recording.samples, recording)) {
    const auto first = static_cast<Index>(segment.first);
    const auto size = static_cast<Index>(segment.last - segment.first + 1);
    SignalPiece piece = piece_of(campaign, columns, times, segment);
    const Index left_out = campaign.sample_time ? 0 : leave_out_rows(campaign.time, piece);
    if (left_out > 0) {
      add_warning(recording, "time",
                  fmt::format("{}: {} of {} rows are left out: they have no time, or are a sample "
                              "that was written before",
                              experiment.name, left_out, size));
    }
    if (times.size() > 0) {
      check_times(experiment.name,
                  campaign.sample_time ? Eigen::VectorXd(times.segment(first, size)) : piece.time,
                  campaign.sample_time, segment.first, recording.findings);
    }
    recording.data.pieces.push_back(std::move(piece));
  }
  for (const Channel& channel : campaign.channels) {
    recording.data.signals.push_back({channel.name, channel.unit, channel.role});
  }
  recording.data.sample_time = campaign.sample_time;
  recording.data.excitation = experiment.excitation;
}

// One of how many samples is taken.
std::size_t thinning_of(const Campaign& campaign, const Experiment& experiment) {
  std::size_t thinning = experiment.every;
  for (const PreprocessStep& step : campaign.preprocess) {
    if (const auto* decimate = std::get_if<Decimate>(&step)) thinning *= decimate->factor;
  }
  return thinning;
}

// Samples of a column before and behind the piece.
std::optional<std::pair<double, double>> range_elsewhere(const Eigen::VectorXd& column,
                                                         const SignalPiece& piece) {
  double lowest = HUGE_VAL, highest = -HUGE_VAL;
  const auto first = static_cast<Index>(piece.first_sample), end = first + piece.values.rows();
  for (Index row = 0; row < column.size(); ++row) {
    if ((row >= first && row < end) || !std::isfinite(column(row))) continue;
    lowest = std::min(lowest, column(row));
    highest = std::max(highest, column(row));
  }
  if (lowest > highest) return {};
  return std::pair{lowest, highest};
}

// The name of an experiment, with the samples of the piece where it has several segments.
std::string name_of_piece(const Experiment& experiment, const SignalPiece& piece) {
  if (experiment.segments.size() < 2) return experiment.name;
  const auto size = static_cast<std::size_t>(piece.time.size());
  return fmt::format("{} (samples {} to {})", experiment.files.begin()->second.filename().string(),
                     piece.first_sample, piece.first_sample + size - 1);
}

// Checks numbers as they were recorded; tells samples that can't be data, by channel.
DataFaults check_piece(const Campaign& campaign, const Experiment& experiment,
                       const std::vector<ChannelColumn>& columns, const SignalPiece& piece,
                       ExperimentRecording& recording) {
  std::vector<ChannelSamples> samples;
  for (std::size_t k = 0; k < campaign.channels.size(); ++k) {
    const Channel& channel = campaign.channels[k];
    const auto values = piece.values.col(static_cast<Index>(k));
    const std::size_t known = recording.findings.size();
    check_signal(fmt::format("{}: {}", name_of_piece(experiment, piece), channel.name), values,
                 channel.range, piece.first_sample, recording.findings);
    for (std::size_t f = known; f < recording.findings.size(); ++f) {
      recording.findings[f].channel = channel.name;
    }
    samples.push_back({.file = experiment.files.at(channel.file).filename().string(),
                       .channel = &channel,
                       .values = values,
                       .time = piece.time,
                       .first_sample = piece.first_sample,
                       .is_even = campaign.sample_time.has_value(),
                       .thinned = thinning_of(campaign, experiment),
                       .elsewhere = range_elsewhere(columns[k].column->values, piece)});
  }
  DataFaults faults;
  if (recording.sound()) faults = find_data_faults(samples, recording.findings);
  const auto size = static_cast<std::size_t>(piece.time.size());
  check_period(experiment, {piece.first_sample, piece.first_sample + size - 1}, recording);
  return faults;
}

void check_pieces(const Campaign& campaign, const Experiment& experiment,
                  const std::vector<ChannelColumn>& columns, ExperimentRecording& recording) {
  std::vector<DataFaults> faults;
  for (const SignalPiece& piece : recording.data.pieces) {
    faults.push_back(check_piece(campaign, experiment, columns, piece, recording));
  }
  if (recording.sound() && campaign.mends_faulty_samples) {
    mend_faulty_samples(faults, recording.data);
  }
}

void take_fingerprints(const Campaign& campaign, ExperimentRecording& recording) {
  for (std::size_t k = 0; k < campaign.channels.size(); ++k) {
    if (campaign.channels[k].role != ChannelRole::kOutput) continue;
    for (const SignalPiece& piece : recording.data.pieces) {
      recording.fingerprints.try_emplace(campaign.channels[k].name,
                                         piece.values.col(static_cast<Index>(k)));
    }
  }
}

void convert_to_base_units(const Campaign& campaign, const Experiment& experiment,
                           ExperimentRecording& recording) {
  for (SignalPiece& piece : recording.data.pieces) {
    for (std::size_t k = 0; k < campaign.channels.size(); ++k) {
      piece.values.col(static_cast<Index>(k)) *= campaign.channels[k].factor;
    }
    thin(experiment, piece);
    const Eigen::VectorXd& time = piece.time;
    recording.duration += time(time.size() - 1) - time(0) + campaign.sample_time.value_or(0.0);
  }
}

// What samples of uneven times cover: no gap between them, and nothing that resampling left out.
double time_of_samples(const Signals& data, double sample_time) {
  Index samples = 0;
  for (const SignalPiece& piece : data.pieces) samples += piece.time.size();
  return sample_time * static_cast<double>(samples);
}

// "position_deg" -> deg, "torque_nm" -> N m; null if the last word is no unit of measurement.
const Unit* unit_in_name(const std::string& name) {
  static constexpr std::array kSpellings = {std::pair{"deg", "deg"}, std::pair{"rad", "rad"},
                                            std::pair{"rpm", "rpm"}, std::pair{"nm", "N m"},
                                            std::pair{"Nm", "N m"},  std::pair{"mm", "mm"},
                                            std::pair{"mA", "mA"},   std::pair{"ms", "ms"}};
  const std::string stem = name.substr(0, name.find('['));
  const std::string word = stem.substr(stem.find_last_of("_ ") + 1);
  if (word.size() == stem.size()) return nullptr;
  for (const auto& [spelling, unit] : kSpellings) {
    if (word == spelling) return find_unit(unit);
  }
  return nullptr;
}

void find_doubtful_channels(const Campaign& campaign, std::vector<Finding>& findings) {
  for (const Channel& channel : campaign.channels) {
    const auto other = std::ranges::find_if(campaign.channels, [&](const Channel& candidate) {
      return candidate.name == channel.column && candidate.column == channel.name;
    });
    if (other != campaign.channels.end() && channel.name < other->name) {
      findings.push_back(
          {Severity::kWarning, "swapped",
           fmt::format("channels {} and {} read each other's columns", channel.name, other->name)});
    }
    const Unit* named = unit_in_name(channel.column);
    if (named != nullptr && named->name != channel.recorded_unit) {
      findings.push_back(
          {Severity::kWarning, "unit",
           fmt::format("channel {}: column {} sounds like {}, but its unit is {}", channel.name,
                       channel.column, named->name, channel.recorded_unit)});
    }
  }
}

// All samples are used where no segment is named.
bool share_samples(const Experiment& a, const Experiment& b) {
  if (a.files != b.files) return false;
  if (a.segments.empty() && b.segments.empty() && a.every == b.every && a.from != b.from) {
    return false;  // interleaved
  }
  if (a.segments.empty() || b.segments.empty()) return true;
  return std::ranges::any_of(a.segments, [&](const Segment& one) {
    return std::ranges::any_of(b.segments, [&](const Segment& other) {
      return one.first <= other.last && other.first <= one.last;
    });
  });
}

void find_shared_samples(const Campaign& campaign, std::vector<Finding>& findings) {
  for (const Experiment& validation : campaign.experiments) {
    if (validation.role != ExperimentRole::kValidation) continue;
    for (const Experiment& estimation : campaign.experiments) {
      if (estimation.role == ExperimentRole::kEstimation && share_samples(validation, estimation)) {
        findings.push_back({Severity::kWarning, "validation",
                            fmt::format("{}: validation uses samples that are for estimation too",
                                        validation.name)});
      }
    }
  }
}

}  // namespace

bool ExperimentRecording::sound() const {
  return std::ranges::none_of(findings,
                              [](const Finding& f) { return f.severity == Severity::kError; });
}

Index ExperimentRecording::index_of(const std::string& name) const {
  const auto found = std::ranges::find(data.signals, name, &Signal::name);
  if (found == data.signals.end()) throw InputError(fmt::format("there is no channel '{}'", name));
  return found - data.signals.begin();
}

ExperimentRecording examine_experiment(const Campaign& campaign, std::size_t index,
                                       MotionPairs pairs) {
  const Experiment& experiment = campaign.experiments[index];
  FilesByKey files;
  for (const auto& [key, path] : experiment.files) files[key] = read_recording_file(path);
  ExperimentRecording recording;
  const std::vector<ChannelColumn> columns = channel_columns(campaign, files);
  check_stated_units(columns, recording);
  check_stated_sample_times(campaign, files, recording);
  if (!equal_lengths(columns, recording)) return recording;
  recording.samples = static_cast<std::size_t>(columns.front().column->values.size());
  Eigen::VectorXd times =
      recorded_times(campaign, files, static_cast<Index>(recording.samples), recording);
  if (!recording.sound()) return recording;
  mend_wrong_stamps(campaign, experiment, times, recording);
  forget_repeated_rows(campaign, columns, times);
  read_pieces(campaign, experiment, columns, times, recording);
  const std::string source = fmt::format("{}: {}", campaign.file.string(), experiment.name);
  const StepGroups steps = step_groups(campaign.preprocess);
  if (recording.sound()) {
    preprocess(source, steps.of_numbers, recording.data);
    check_pieces(campaign, experiment, columns, recording);
  }
  if (!recording.sound()) {
    recording.data = {};
    return recording;
  }
  take_fingerprints(campaign, recording);
  convert_to_base_units(campaign, experiment, recording);
  preprocess(source, steps.of_channels, recording.data);
  if (pairs == MotionPairs::kCompared) {
    find_late_channels(experiment.name, recording.data, recording.findings);
  }
  preprocess(source, steps.others, recording.data);
  if (!campaign.sample_time && recording.data.sample_time) {
    recording.duration = time_of_samples(recording.data, *recording.data.sample_time);
  }
  for (const std::string& remark : recording.data.remarks) {
    add_warning(recording, "accuracy", fmt::format("{}: {}", experiment.name, remark));
  }
  return recording;
}

void CopyFinder::examine(const Experiment& experiment, ExperimentRecording& recording) {
  for (const Known& known : known_) {
    if (known.experiment->files == experiment.files) continue;
    for (const auto& [channel, fingerprint] : recording.fingerprints) {
      const auto there = known.fingerprints.find(channel);
      if (there == known.fingerprints.end()) continue;
      const auto copy = fingerprint.shared_with(there->second);
      if (!copy) continue;
      add_warning(recording, "copy",
                  fmt::format("{}: {} holds the same samples as {}, bit by bit ({} windows of 64; "
                              "sample {} here is sample {} there): is it a copy? could also be a "
                              "simulation without noise; remove one of the two experiments",
                              experiment.name, channel, known.experiment->name, copy->windows,
                              copy->first, copy->first_there));
      break;
    }
  }
  known_.push_back({&experiment, recording.fingerprints});
}

ExperimentRecording load_experiment(const Campaign& campaign, std::size_t index) {
  ExperimentRecording recording = examine_experiment(campaign, index);
  for (const Finding& finding : recording.findings) {
    if (finding.severity == Severity::kError) throw InputError(finding.message);
  }
  return recording;
}

std::vector<Finding> examine_campaign(const Campaign& campaign) {
  std::vector<Finding> findings;
  find_doubtful_channels(campaign, findings);
  find_shared_samples(campaign, findings);
  if (!campaign.sample_time_known) {
    findings.push_back({Severity::kWarning, "time",
                        "the sample time is unknown and counts as 1 s: read every s as a sample, "
                        "in results as in the model"});
  }
  return findings;
}

}  // namespace graybox
