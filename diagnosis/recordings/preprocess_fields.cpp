#include "diagnosis/recordings/preprocess_fields.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "problems/base/units.hpp"

namespace graybox {
namespace {

std::vector<std::string> words_in(const YamlField& field) {
  std::vector<std::string> words;
  for (const YamlField& item : field.items()) words.push_back(item.text());
  return words;
}

// Names of the channels that exist before a step, and after it.
class ChannelNames {
 public:
  explicit ChannelNames(const std::vector<Channel>& channels) {
    for (const Channel& channel : channels) names_.push_back(channel.name);
  }
  std::vector<std::string> existing(const YamlField& field) const {
    std::vector<std::string> names;
    for (const YamlField& item : field.items()) names.push_back(existing_name(item));
    return names;
  }
  std::string existing_name(const YamlField& field) const {
    if (!contains(field.text())) {
      field.fail(fmt::format("no such channel; there are: {}", fmt::join(names_, ", ")));
    }
    return field.text();
  }
  std::string added_name(const YamlField& field) {
    const std::string name = field.text();
    if (contains(name)) field.fail(fmt::format("'{}' is a channel already", name));
    names_.push_back(name);
    return name;
  }
  std::vector<std::string> added(const YamlField& field, std::size_t count) {
    const std::vector<std::string> names = words_in(field);
    if (names.size() != count) {
      field.fail(fmt::format("must name {} channels, names {}", count, names.size()));
    }
    for (const std::string& name : names) {
      if (contains(name)) field.fail(fmt::format("'{}' is a channel already", name));
      names_.push_back(name);
    }
    return names;
  }

 private:
  bool contains(const std::string& name) const {
    return std::ranges::find(names_, name) != names_.end();
  }
  std::vector<std::string> names_;
};

std::optional<ChannelRole> optional_role(const YamlField& field) {
  if (!field.has("is")) return {};
  return channel_role_in(field.at("is"));
}

LowPass low_pass_in(const YamlField& field, const ChannelNames& names) {
  field.allow_keys({"kind", "frequency", "order", "channels"});
  LowPass step{.frequency = field.at("frequency").positive(), .order = 4, .channels = {}};
  if (field.has("order")) {
    const std::size_t order = field.at("order").count();
    if (order > 12) field.at("order").fail("must be at most 12");
    step.order = static_cast<int>(order);
  }
  if (field.has("channels")) step.channels = names.existing(field.at("channels"));
  return step;
}

Derivative derivative_in(const YamlField& field, ChannelNames& names) {
  field.allow_keys({"kind", "of", "name", "is", "method"});
  Derivative step;
  if (field.has("method")) {
    step.band_limited = field.at("method").choice({"parabola", "band_limited"}) == "band_limited";
  }
  step.of = names.existing(field.at("of"));
  step.names = names.added(field.at("name"), step.of.size());
  step.role = optional_role(field);
  return step;
}

Eigen::MatrixXd transmission_matrix(const YamlField& field, std::size_t size) {
  if (field.has("gear_ratios") == field.has("matrix")) {
    field.fail("needs either gear_ratios or matrix (motor angles = matrix * arm angles)");
  }
  const auto n = static_cast<Eigen::Index>(size);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(n, n);
  if (field.has("gear_ratios")) {
    const std::vector<double> ratios = field.at("gear_ratios").numbers(size);
    for (Eigen::Index i = 0; i < n; ++i) matrix(i, i) = ratios[static_cast<std::size_t>(i)];
  } else {
    const std::vector<YamlField> rows = field.at("matrix").items();
    if (rows.size() != size) {
      field.at("matrix").fail(fmt::format("must have {} rows, has {}", size, rows.size()));
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::vector<double> row = rows[static_cast<std::size_t>(i)].numbers(size);
      matrix.row(i) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), n);
    }
  }
  if (n == 0 || !Eigen::FullPivLU<Eigen::MatrixXd>(matrix).isInvertible()) {
    field.fail("can't be inverted; no gear ratio may be zero and no axes may be lost");
  }
  return matrix;
}

Transmission transmission_in(const YamlField& field, ChannelNames& names) {
  field.allow_keys({"kind", "towards", "of", "name", "is", "gear_ratios", "matrix"});
  Transmission step;
  step.to_arm = field.at("towards").choice({"arm", "motor"}) == "arm";
  step.of = names.existing(field.at("of"));
  step.names = names.added(field.at("name"), step.of.size());
  step.matrix = transmission_matrix(field, step.of.size());
  step.role = optional_role(field);
  return step;
}

// ---- steps that mend ----------------------------------------------------------------------------

std::pair<double, double> range_in(const YamlField& field) {
  const std::vector<double> limits = field.numbers(2);
  if (limits[0] > limits[1]) field.fail("must be [lowest, highest]");
  return {limits[0], limits[1]};
}

ValidSamples valid_in(const YamlField& field, const ChannelNames& names) {
  field.allow_keys({"kind", "of", "range"});
  constexpr double kAny = std::numeric_limits<double>::max();  // but no infinity
  std::pair<double, double> range{-kAny, kAny};
  if (field.has("range")) range = range_in(field.at("range"));
  return {names.existing(field.at("of")), range.first, range.second};
}

ValidSamples rows_in(const YamlField& field, const ChannelNames& names) {
  field.allow_keys({"kind", "by", "equals", "range"});
  if (field.has("equals") == field.has("range")) {
    field.fail("needs either equals: value or range: [lowest, highest]");
  }
  const double value = field.has("equals") ? field.at("equals").number() : 0.0;
  const auto range = field.has("equals") ? std::pair{value, value} : range_in(field.at("range"));
  return {{names.existing_name(field.at("by"))}, range.first, range.second};
}

double turn_of(const YamlField& field, const Channel& channel) {
  const double turn = channel.turn();
  if (turn > 0.0) return turn;
  field.fail(fmt::format("{} is in {}, which has no turns; state bits: 8, 16 or 32, or a period",
                         channel.name, channel.unit));
}

double period_in(const YamlField& field, const Channel& channel) {
  if (field.has("bits") && field.has("period")) field.fail("needs either bits or period, not both");
  if (field.has("period")) return field.at("period").positive();
  if (!field.has("bits")) return turn_of(field, channel);
  const std::size_t bits = field.at("bits").count();
  if (bits != 8 && bits != 16 && bits != 32) field.at("bits").fail("must be 8, 16 or 32");
  return std::ldexp(1.0, static_cast<int>(bits));
}

void add_unwraps(const YamlField& field, const ChannelNames& names,
                 const std::vector<Channel>& channels, std::vector<PreprocessStep>& steps) {
  field.allow_keys({"kind", "of", "bits", "period"});
  for (const std::string& name : names.existing(field.at("of"))) {
    const auto channel = std::ranges::find(channels, name, &Channel::name);
    if (channel == channels.end()) field.at("of").fail(name + " was not recorded");
    steps.emplace_back(Unwrap{{name}, period_in(field, *channel)});
  }
}

Scale scale_in(const YamlField& field, const ChannelNames& names) {
  field.allow_keys({"kind", "of", "factor"});
  const double factor = field.at("factor").number();
  if (factor == 0.0) field.at("factor").fail("must not be zero");
  return {names.existing(field.at("of")), factor};
}

// ---- steps that add channels --------------------------------------------------------------------

Integral integral_in(const YamlField& field, ChannelNames& names) {
  field.allow_keys({"kind", "of", "name", "is"});
  Integral step{names.existing(field.at("of")), {}, optional_role(field)};
  step.names = names.added(field.at("name"), step.of.size());
  return step;
}

// The base unit that a computed channel states.
std::string base_unit_in(const YamlField& field) {
  const Unit* unit = find_unit(field.text());
  if (unit == nullptr || unit->name != unit->base) {
    field.fail("must be a unit without a factor, as rad, rad/s, m, N, N m, A, V or 1");
  }
  return field.text();
}

Product product_in(const YamlField& field, ChannelNames& names) {
  field.allow_keys({"kind", "of", "name", "unit", "is"});
  Product step{names.existing(field.at("of")), {}, {}, optional_role(field)};
  if (step.of.size() < 2) field.at("of").fail("must name at least two channels");
  step.unit = base_unit_in(field.at("unit"));
  step.name = names.added_name(field.at("name"));
  return step;
}

WeightedSum sum_in(const YamlField& field, ChannelNames& names) {
  field.allow_keys({"kind", "of", "weights", "name", "unit", "is"});
  WeightedSum step{names.existing(field.at("of")), {}, {}, {}, optional_role(field)};
  if (step.of.size() < 2) field.at("of").fail("must name at least two channels");
  step.weights.assign(step.of.size(), 1.0);
  if (field.has("weights")) step.weights = field.at("weights").numbers(step.of.size());
  if (field.has("unit")) step.unit = base_unit_in(field.at("unit"));
  step.name = names.added_name(field.at("name"));
  return step;
}

ConstantChannel constant_in(const YamlField& field, ChannelNames& names) {
  field.allow_keys({"kind", "name", "value", "unit", "is"});
  return {.name = names.added_name(field.at("name")),
          .value = field.at("value").number(),
          .unit = base_unit_in(field.at("unit")),
          .role = channel_role_in(field.at("is"))};
}

MotorTorque motor_torque_in(const YamlField& field, ChannelNames& names) {
  field.allow_keys(
      {"kind", "voltage", "speed", "torque_constant", "back_emf", "resistance", "name", "is"});
  MotorTorque step{.voltage = names.existing_name(field.at("voltage")),
                   .speed = names.existing_name(field.at("speed")),
                   .torque_constant = field.at("torque_constant").positive(),
                   .back_emf = field.at("back_emf").non_negative(),
                   .resistance = field.at("resistance").positive(),
                   .name = names.added_name(field.at("name"))};
  step.role = optional_role(field).value_or(ChannelRole::kInput);
  return step;
}

// ---- the list -----------------------------------------------------------------------------------

// Those that add no channel.
void add_change(const YamlField& item, const std::string& kind, const ChannelNames& names,
                const std::vector<Channel>& channels, std::vector<PreprocessStep>& steps) {
  if (kind == "low_pass") {
    steps.emplace_back(low_pass_in(item, names));
  } else if (kind == "decimate") {
    item.allow_keys({"kind", "factor"});
    steps.emplace_back(Decimate{item.at("factor").count()});
  } else if (kind == "trim") {
    item.allow_keys({"kind", "time"});
    steps.emplace_back(Trim{item.at("time").positive()});
  } else if (kind == "valid") {
    steps.emplace_back(valid_in(item, names));
  } else if (kind == "rows") {
    steps.emplace_back(rows_in(item, names));
  } else if (kind == "unwrap") {
    add_unwraps(item, names, channels, steps);
  } else if (kind == "resample") {
    item.allow_keys({"kind", "sample_time"});
    steps.emplace_back(Resample{item.at("sample_time").positive()});
  } else if (kind == "sign") {
    item.allow_keys({"kind", "of"});
    steps.emplace_back(Scale{names.existing(item.at("of")), -1.0});
  } else if (kind == "scale") {
    steps.emplace_back(scale_in(item, names));
  } else {
    item.allow_keys({"kind", "of", "time"});
    steps.emplace_back(Advance{names.existing(item.at("of")), item.at("time").positive()});
  }
}

// False if the kind is not one of those that add channels.
bool add_channels(const YamlField& item, const std::string& kind, ChannelNames& names,
                  std::vector<PreprocessStep>& steps) {
  if (kind == "derivative") {
    steps.emplace_back(derivative_in(item, names));
  } else if (kind == "transmission") {
    steps.emplace_back(transmission_in(item, names));
  } else if (kind == "integral") {
    steps.emplace_back(integral_in(item, names));
  } else if (kind == "product") {
    steps.emplace_back(product_in(item, names));
  } else if (kind == "sum") {
    steps.emplace_back(sum_in(item, names));
  } else if (kind == "motor_torque") {
    steps.emplace_back(motor_torque_in(item, names));
  } else if (kind == "constant") {
    steps.emplace_back(constant_in(item, names));
  } else {
    return false;
  }
  return true;
}

}  // namespace

ChannelRole channel_role_in(const YamlField& field) {
  const std::string word = field.choice({"input", "output", "reference", "other"});
  if (word == "input") return ChannelRole::kInput;
  if (word == "output") return ChannelRole::kOutput;
  return word == "reference" ? ChannelRole::kReference : ChannelRole::kOther;
}

bool mends_recorded(const PreprocessStep& step) {
  return std::holds_alternative<ValidSamples>(step) || std::holds_alternative<Unwrap>(step);
}

std::vector<PreprocessStep> preprocess_steps_in(const YamlField& field,
                                                const std::vector<Channel>& channels) {
  std::vector<PreprocessStep> steps;
  ChannelNames names(channels);
  for (const YamlField& item : field.items()) {
    const std::string kind =
        item.at("kind").choice({"low_pass", "decimate", "derivative", "transmission", "trim",
                                "valid", "rows", "unwrap", "resample", "sign", "scale", "advance",
                                "integral", "product", "sum", "motor_torque", "constant"});
    const bool late = !steps.empty() && !mends_recorded(steps.back());
    if (!add_channels(item, kind, names, steps)) add_change(item, kind, names, channels, steps);
    if (late && mends_recorded(steps.back())) {
      item.fail(fmt::format("{} mends numbers as they were recorded; put it before all other steps",
                            kind));
    }
  }
  return steps;
}

}  // namespace graybox
