#include "diagnosis/recordings/campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <string_view>

#include "diagnosis/recording_files/written_unit.hpp"
#include "diagnosis/recordings/preprocess_fields.hpp"
#include "problems/base/units.hpp"
#include "problems/files/environment_text.hpp"
#include "problems/files/file_kind.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

const Unit& unit_in(const YamlField& field) {
  const Unit* unit = find_unit(unit_as_written(field.text()));
  if (unit == nullptr) {
    field.fail(fmt::format("unknown unit '{}'; known: {}", field.text(), known_unit_names()));
  }
  return *unit;
}

std::size_t index_in(const YamlField& field) {
  const double value = field.non_negative();
  if (value != std::floor(value) || value > 1e12) {
    field.fail(fmt::format("must be a whole number from 0 on, is {}", value));
  }
  return static_cast<std::size_t>(value);
}

// ---- channels -----------------------------------------------------------------------------------

// gain: {value: 0.12, unit: N m/A}: what one recorded unit is worth. Units of which one has a
// stroke may be in brackets: (m/s)/(mm/s).
void apply_gain(const YamlField& field, Channel& channel) {
  field.allow_keys({"value", "unit"});
  const double value = field.at("value").number();
  if (value == 0.0) field.at("value").fail("must not be zero");
  std::string unit = field.at("unit").text();
  std::erase_if(unit, [](char c) { return c == '(' || c == ')'; });
  const std::string divisor = "/" + channel.recorded_unit;
  if (!unit.ends_with(divisor)) {
    field.at("unit").fail(
        fmt::format("is '{}', but the channel is recorded in {}; write it as '.../{}'", unit,
                    channel.recorded_unit, channel.recorded_unit));
  }
  const std::string product = unit.substr(0, unit.size() - divisor.size());
  const Unit* base = find_unit(product);
  if (base == nullptr) {
    field.at("unit").fail(fmt::format("unknown unit '{}'; known: {}", product, known_unit_names()));
  }
  channel.factor = value * base->factor;
  channel.unit = base->base;
}

Channel channel_in(const YamlField& field) {
  field.allow_keys({"name", "unit", "is", "column", "file", "gain", "range"});
  Channel channel;
  channel.name = field.at("name").text();
  channel.role = channel_role_in(field.at("is"));
  const Unit& unit = unit_in(field.at("unit"));
  channel.recorded_unit = unit.name;
  channel.unit = unit.base;
  channel.factor = unit.factor;
  if (field.has("gain")) apply_gain(field.at("gain"), channel);
  channel.column = field.has("column") ? field.at("column").text() : channel.name;
  if (field.has("file")) channel.file = field.at("file").text();
  if (field.has("range")) {
    const std::vector<double> limits = field.at("range").numbers(2);
    if (limits[0] >= limits[1]) field.at("range").fail("must be [lowest, highest]");
    channel.range = {limits[0], limits[1]};
  }
  return channel;
}

std::vector<Channel> channels_in(const YamlField& field) {
  std::vector<Channel> channels;
  std::set<std::string> names;
  std::set<std::pair<std::string, std::string>> columns;
  for (const YamlField& item : field.items()) {
    channels.push_back(channel_in(item));
    const Channel& channel = channels.back();
    if (!names.insert(channel.name).second) {
      item.at("name").fail(fmt::format("'{}' is given twice; names are unique", channel.name));
    }
    if (!columns.insert({channel.file, channel.column}).second) {
      item.fail(fmt::format("column '{}' is read twice; each channel has a column of its own",
                            channel.column));
    }
  }
  if (channels.empty()) field.fail("there are no channels; list at least one");
  return channels;
}

void read_noise(const YamlField& field, std::vector<Channel>& channels) {
  for (const auto& [name, value] : field.entries()) {
    const auto channel = std::ranges::find(channels, name, &Channel::name);
    if (channel == channels.end()) value.fail("no such channel");
    channel->noise = value.non_negative() * std::abs(channel->factor);
  }
}

// ---- experiments --------------------------------------------------------------------------------

fs::path data_file(const YamlField& field, const fs::path& folder) {
  const fs::path path = folder / with_environment(field);  // an absolute path stays what it is
  if (!is_file(path)) {
    field.fail(fmt::format("there is no file {}; correct the name or remove the experiment",
                           path.string()));
  }
  return path;
}

void read_files(const YamlField& field, const Campaign& campaign, Experiment& experiment) {
  if (field.has("file") == field.has("files")) {
    field.fail("needs either file or files ({key: file, ...})");
  }
  const fs::path folder = campaign.file.parent_path();
  if (field.has("file")) {
    experiment.files[""] = data_file(field.at("file"), folder);
  } else {
    for (const auto& [key, value] : field.at("files").entries()) {
      experiment.files[key] = data_file(value, folder);
    }
    if (experiment.files.empty()) field.at("files").fail("names no file");
  }
  experiment.name = experiment.files.begin()->second.filename().string();
  for (const Channel& channel : campaign.channels) {
    if (experiment.files.contains(channel.file)) continue;
    const bool single = experiment.files.contains("");
    field.fail(single ? fmt::format("channel {} wants file '{}', but the experiment has one file; "
                                    "write files: {{{}: ...}}",
                                    channel.name, channel.file, channel.file)
                      : fmt::format("channel {} wants file '{}', which is not among the "
                                    "experiment's files",
                                    channel.name, channel.file));
  }
}

PeriodicExcitation excitation_in(const YamlField& field) {
  field.allow_keys({"period", "periods", "lines"});
  PeriodicExcitation excitation{
      .period = field.at("period").count(), .periods = field.at("periods").count(), .lines = {}};
  for (const YamlField& item : field.at("lines").items()) {
    const std::size_t line = index_in(item);
    if (2 * line > excitation.period) {
      item.fail(fmt::format("is above half the period ({} samples)", excitation.period));
    }
    if (!excitation.lines.empty() && line <= excitation.lines.back()) {
      item.fail("lines must rise");
    }
    excitation.lines.push_back(line);
  }
  return excitation;
}

std::vector<Segment> segments_in(const YamlField& field) {
  std::vector<Segment> segments;
  for (const YamlField& item : field.items()) {
    const std::vector<YamlField> ends = item.items();
    if (ends.size() != 2) item.fail("must be [first sample, last sample], counted from 0");
    segments.push_back({index_in(ends[0]), index_in(ends[1])});
    if (segments.back().last <= segments.back().first) {
      item.fail("the last sample must come after the first");
    }
  }
  return segments;
}

// Leaving out even samples would fold frequencies; of irregular ones it halves a set in two.
void read_every(const YamlField& field, const Campaign& campaign, Experiment& experiment) {
  field.allow_keys({"samples", "from"});
  if (campaign.sample_time) field.fail("is for irregular samples; decimate others in preprocess");
  experiment.every = field.at("samples").count();
  experiment.from = index_in(field.at("from"));
  if (experiment.from >= experiment.every) field.at("from").fail("must be below `samples`");
}

Experiment experiment_in(const YamlField& field, const Campaign& campaign) {
  field.allow_keys({"file", "files", "position", "level", "realisation", "sub_experiment",
                    "excitation", "segments", "every", "role", "load"});
  Experiment experiment;
  read_files(field, campaign, experiment);
  if (field.has("position")) {
    for (const YamlField& item : field.at("position").items()) {
      experiment.position.push_back(item.number());
    }
  }
  if (field.has("level")) experiment.level = field.at("level").positive();
  if (field.has("realisation")) experiment.realisation = field.at("realisation").count();
  if (field.has("sub_experiment")) experiment.sub_experiment = field.at("sub_experiment").count();
  if (field.has("excitation")) experiment.excitation = excitation_in(field.at("excitation"));
  if (field.has("segments")) experiment.segments = segments_in(field.at("segments"));
  if (field.has("every")) read_every(field.at("every"), campaign, experiment);
  if (field.has("role") && field.at("role").choice({"estimation", "validation"}) == "validation") {
    experiment.role = ExperimentRole::kValidation;
  }
  if (field.has("load")) experiment.load = field.at("load").text();
  return experiment;
}

// "samples 0 to 199", "samples 0 to 199 and 400 to 499", "samples 0 to 900 in 4 parts".
std::string segment_words(const std::vector<Segment>& segments) {
  constexpr std::size_t kListed = 2;
  const auto words = [](const Segment& segment) {
    return fmt::format("{} to {}", segment.first, segment.last);
  };
  if (segments.size() > kListed) {
    return fmt::format("samples {} to {} in {} parts", segments.front().first, segments.back().last,
                       segments.size());
  }
  return segments.size() < kListed
             ? "samples " + words(segments.front())
             : fmt::format("samples {} and {}", words(segments.front()), words(segments.back()));
}

// Experiments of one name are told apart by their folders, and parts of one file by their samples.
void tell_experiments_apart(Campaign& campaign) {
  std::vector<std::string> names;
  for (const Experiment& experiment : campaign.experiments) names.push_back(experiment.name);
  for (Experiment& experiment : campaign.experiments) {
    const std::string name = experiment.name;
    if (std::ranges::count(names, name) < 2) continue;
    const fs::path& path = experiment.files.begin()->second;
    const bool is_of_one_file = std::ranges::all_of(campaign.experiments, [&](const auto& other) {
      const fs::path& others = other.files.begin()->second;
      return others.filename() != path.filename() || others == path;
    });
    if (!is_of_one_file) {
      experiment.name = path.lexically_relative(campaign.file.parent_path()).generic_string();
      if (experiment.name.empty()) experiment.name = path.generic_string();
    }
    if (experiment.segments.empty()) continue;
    experiment.name += fmt::format(" ({})", segment_words(experiment.segments));
  }
}

// ---- the whole ----------------------------------------------------------------------------------

void read_time(const YamlField& root, Campaign& campaign) {
  const YamlField sample_time = root.at("sample_time");
  if (sample_time.text() == "unknown") {
    if (root.has("time")) root.at("time").fail("an unknown sample_time leaves no use for times");
    campaign.sample_time = 1.0;
    campaign.sample_time_known = false;
    campaign.time.column.clear();
    return;
  }
  if (sample_time.text() != "irregular") campaign.sample_time = sample_time.positive();
  if (!root.has("time")) {
    campaign.time.required = !campaign.sample_time.has_value();
    return;
  }
  const YamlField field = root.at("time");
  if (!field.is_mapping()) {
    (void)field.choice({"ignore"});
    if (!campaign.sample_time) field.fail("irregular samples need their times");
    campaign.time.column.clear();
    return;
  }
  field.allow_keys({"column", "unit", "factor", "burst"});
  const Unit& unit = unit_in(field.at("unit"));
  if (unit.base != "s") field.at("unit").fail("must be a unit of time: s, ms, us, ns, min");
  const double factor = field.has("factor") ? field.at("factor").positive() : 1.0;
  campaign.time = {.column = field.at("column").text(),
                   .factor = factor * unit.factor,
                   .required = true,
                   .has_unit = true,
                   .burst = field.has("burst") ? field.at("burst").non_negative() : -1.0};
  if (field.has("burst") && campaign.sample_time) {
    field.at("burst").fail("is for sample_time: irregular");
  }
}

InputHold hold_in(const YamlField& field) {
  const std::string word = field.choice({"zero", "first", "band_limited"});
  if (word == "zero") return InputHold::kZero;
  return word == "first" ? InputHold::kFirst : InputHold::kBandLimited;
}

}  // namespace

double Channel::turn() const {
  return unit == "rad" ? 2.0 * std::numbers::pi / std::abs(factor) : 0.0;
}

const char* name_of(ChannelRole role) {
  switch (role) {
    case ChannelRole::kInput:
      return "input";
    case ChannelRole::kOutput:
      return "output";
    case ChannelRole::kReference:
      return "reference";
    case ChannelRole::kOther:
      break;
  }
  return "other";
}

const char* name_of(ExperimentRole role) {
  return role == ExperimentRole::kEstimation ? "estimation" : "validation";
}

Campaign read_campaign(const fs::path& path) {
  Campaign campaign;
  campaign.file = is_folder(path) ? path / "campaign.yaml" : path;
  const YamlField root = YamlField::load(campaign.file);
  root.allow_keys({"format", "model", "sample_time", "time", "channels", "hold", "noise",
                   "faulty_samples", "preprocess", "experiments"});
  (void)root.at("format").choice({"graybox-campaign/1"});
  if (root.has("model")) campaign.model = root.at("model").text();
  read_time(root, campaign);
  campaign.channels = channels_in(root.at("channels"));
  if (root.has("hold")) campaign.hold = hold_in(root.at("hold"));
  if (root.has("faulty_samples")) {
    campaign.mends_faulty_samples = root.at("faulty_samples").choice({"mend", "keep"}) == "mend";
  }
  if (root.has("noise")) read_noise(root.at("noise"), campaign.channels);
  if (root.has("preprocess")) {
    campaign.preprocess = preprocess_steps_in(root.at("preprocess"), campaign.channels);
  }
  for (const YamlField& item : root.at("experiments").items()) {
    campaign.experiments.push_back(experiment_in(item, campaign));
  }
  if (campaign.experiments.empty()) root.at("experiments").fail("there are no experiments");
  tell_experiments_apart(campaign);
  return campaign;
}

}  // namespace graybox
