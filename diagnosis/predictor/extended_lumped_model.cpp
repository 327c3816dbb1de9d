#include "diagnosis/predictor/extended_lumped_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace graybox {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kVanishing = 1e-9;        // of a stated damping
constexpr double kBearingFactor = 1000.0;  // how far its damping may rise: it is often a guess
constexpr double kLargest = 30.0;          // of the rms of what acts
constexpr double kShapeFactor = 20.0;      // how far a gap, a velocity or a time may move

std::size_t mass_count(const LumpedModel& model) {
  return static_cast<std::size_t>((model.masses.array() != 0.0).count());
}

// The viscous element whose parameter it is, if any.
const Element* damper_of(const LumpedModel& model, std::size_t parameter) {
  std::size_t next = mass_count(model);
  for (const Element& part : model.parts) {
    if (parameter >= next && parameter < next + part.parameters.size()) {
      return part.law_name == "viscous" ? &part : nullptr;
    }
    next += part.parameters.size();
  }
  return nullptr;
}

bool has_free_motion(const LumpedModel& model) {
  return std::ranges::any_of(model.imposed, [](bool imposed) { return !imposed; });
}

// Where a parameter that the model states may move.
ParameterSpace stated_space(const LumpedModel& model, std::size_t index, double factor) {
  const LumpedParameter& parameter = model.parameters[index];
  const double size = std::abs(parameter.value) > 0.0 ? std::abs(parameter.value) : 1.0;
  const bool is_scaled = parameter.value > 0.0 && has_free_motion(model);
  const bool is_positive = parameter.range == ParameterRange::kPositive;
  if (parameter.value > 0.0 && (is_scaled || is_positive)) {
    if (const Element* const damper = damper_of(model, index)) {
      // One between masses would rise until it locks them together.
      const bool is_bearing = (damper->location.output.array() != 0.0).count() == 1;
      const double most = is_bearing ? std::max(factor, kBearingFactor) : factor;
      return {true, size, kVanishing * size, size * most};
    }
    return {true, size, size / factor, size * factor};
  }
  double low = -kInfinite;
  if (parameter.range == ParameterRange::kNonNegative) low = 0.0;
  return {false, size, low, kInfinite};
}

ParameterSpace law_space(const LawParameter& parameter, const LawExtension& law, std::size_t p,
                         double value) {
  using enum ParameterRange;
  const double size = std::abs(value) > 0.0 ? std::abs(value) : 1.0;
  const double least = std::strtod(parameter.at_least.c_str(), nullptr);  // 0 of a name
  if (law.is_secant && parameter.range == kPositive) {
    return {true, size, size / kShapeFactor, size * kShapeFactor};
  }
  if (law.direction[p] != 0.0) {
    const double scale = law.unit * std::abs(law.direction[p]);
    // No law of one sign takes much more than all the force there is.
    const double high = law.one_sided ? kLargest * scale : kInfinite;
    if (parameter.range == kPositive) return {false, scale, kVanishing * scale, high};
    const bool from_zero = parameter.range == kNonNegative || (law.one_sided && law.base[p] == 0.0);
    return {false, scale, from_zero ? 0.0 : -kInfinite, high};
  }
  if (parameter.range == kUnitInterval) return {false, 1.0, least, 1.0};
  if (value > 0.0 && (parameter.range == kPositive || parameter.range == kNonNegative)) {
    return {true, size, std::max(size / kShapeFactor, least), size * kShapeFactor};
  }
  return {false, size, parameter.range == kNonNegative ? 0.0 : -kInfinite, kInfinite};
}

}  // namespace

bool is_one_mass_alone(const LumpedModel& model) {
  if (model.mass_names.size() != 1 || model.has_imposed_motion()) return false;
  std::size_t next = model.parameters.size();
  for (const Element& part : model.parts) next -= part.parameters.size();
  return std::ranges::all_of(model.parts, [&](const Element& part) {
    const std::size_t first = std::exchange(next, next + part.parameters.size());
    const bool is_known_spring = part.law_name == "stiffness" && model.parameters[first].fixed;
    return part.law_name == "viscous" || is_known_spring;
  });
}

bool ParameterSpace::may_vanish() const { return low < 10.0 * kVanishing * scale; }

double ParameterSpace::coordinate(double value) const {
  return logarithmic ? std::log(std::max(value, 1e-300)) : value / scale;
}

double ParameterSpace::value(double coordinate) const {
  return std::clamp(logarithmic ? std::exp(coordinate) : coordinate * scale, low, high);
}

std::vector<std::size_t> ExtendedLumpedModel::free_parameters() const {
  std::vector<std::size_t> free;
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    if (!model.parameters[i].fixed) free.push_back(i);
  }
  return free;
}

std::vector<double> ExtendedLumpedModel::values() const {
  std::vector<double> values;
  for (const LumpedParameter& parameter : model.parameters) values.push_back(parameter.value);
  return values;
}

std::size_t ExtendedLumpedModel::first_parameter(std::size_t part) const {
  std::size_t first = mass_count(model);
  for (std::size_t i = 0; i < part; ++i) first += model.parts[i].parameters.size();
  return first;
}

std::size_t ExtendedLumpedModel::own_parameters() const {
  return laws.empty() ? model.parameters.size() : first_parameter(laws.front().part);
}

ExtendedLumpedModel as_given(const LumpedModel& model, double factor) {
  ExtendedLumpedModel result{model, {}, {}};
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    result.space.push_back(stated_space(model, i, factor));
  }
  return result;
}

ExtendedLumpedModel without_part(const ExtendedLumpedModel& model, std::size_t part) {
  ExtendedLumpedModel result = model;
  const auto first = static_cast<std::ptrdiff_t>(model.first_parameter(part));
  const auto count = static_cast<std::ptrdiff_t>(model.model.parts[part].parameters.size());
  LumpedModel& lumped = result.model;
  lumped.parts.erase(lumped.parts.begin() + static_cast<std::ptrdiff_t>(part));
  lumped.parameters.erase(lumped.parameters.begin() + first,
                          lumped.parameters.begin() + first + count);
  result.space.erase(result.space.begin() + first, result.space.begin() + first + count);
  std::erase_if(result.laws, [&](const PlacedFinding& law) { return law.part == part; });
  for (PlacedFinding& law : result.laws) law.part -= law.part > part ? 1 : 0;
  return with_values(result, result.values());
}

ExtendedLumpedModel extended(const ExtendedLumpedModel& model, const LawExtension& law,
                             double amplitude) {
  ExtendedLumpedModel result = model;
  if (law.own_start) {
    const ParameterSpace& space = model.space[law.own_start->parameter];
    result.model.parameters[law.own_start->parameter].value =
        std::clamp(law.own_start->value, space.low, space.high);
  }
  if (law.replaces) result = without_part(result, *law.replaces);
  const LawEntry& entry = *find_law(law.law, law.location.kind != LocationKind::kElement);
  Element part;
  part.name =
      fmt::format("found {} at {} ({})", law.law, law.location.name, result.model.parts.size());
  part.location = law.location;
  part.law_name = law.law;
  part.use = entry.use;
  part.fixed = law.fixed;
  for (std::size_t p = 0; p < entry.parameters.size(); ++p) {
    const double value = law.base[p] + amplitude * law.direction[p];
    ParameterSpace space = law_space(entry.parameters[p], law, p, value);
    if (!law.most.empty()) space.high = std::min(space.high, law.most[p]);
    part.parameters.push_back(std::clamp(value, space.low, space.high));
    result.model.parameters.push_back({part.name + "." + entry.parameters[p].name,
                                       unit_at(entry.parameters[p].unit, law.location.units),
                                       part.parameters.back(), entry.parameters[p].range,
                                       law.fixed[p]});
    result.space.push_back(space);
  }
  result.laws.push_back({law.hypothesis, result.model.parts.size()});
  result.model.parts.push_back(std::move(part));
  return with_values(result, result.values());
}

ExtendedLumpedModel with_last_law_of(const ExtendedLumpedModel& donor,
                                     const ExtendedLumpedModel& model) {
  ExtendedLumpedModel result = model;
  const PlacedFinding& law = donor.laws.back();
  const std::size_t first = donor.first_parameter(law.part);
  const Element& part = donor.model.parts[law.part];
  for (std::size_t p = first; p < first + part.parameters.size(); ++p) {
    result.model.parameters.push_back(donor.model.parameters[p]);
    result.space.push_back(donor.space[p]);
  }
  result.laws.push_back({law.hypothesis, result.model.parts.size()});
  result.model.parts.push_back(part);
  return with_values(result, result.values());
}

ExtendedLumpedModel with_values(const ExtendedLumpedModel& model,
                                const std::vector<double>& values) {
  ExtendedLumpedModel result{with_parameters(model.model, values), model.space, model.laws};
  return result;
}

}  // namespace graybox
