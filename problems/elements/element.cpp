#include "problems/elements/element.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "problems/files/yaml_field.hpp"
#include "problems/laws/law_file.hpp"

namespace graybox {
namespace {

const LawEntry& read_law(const YamlField& field, const Location& location) {
  const bool at_signal = location.kind != LocationKind::kElement;
  const std::string name = field.text();
  const LawEntry* entry = find_law(name, at_signal);
  if (entry != nullptr) return *entry;
  std::vector<std::string> known;
  for (const auto* list : {&law_catalogue(), &supplementary_laws()}) {
    for (const LawEntry& law : *list) {
      if (find_law(law.name, at_signal) == &law) known.push_back(law.name);
    }
  }
  field.fail(
      fmt::format("no law '{}' at {}; there are {}", name, location.name, fmt::join(known, ", ")));
}

void check_law_fits_place(const YamlField& field, const LawEntry& entry, const Location& location) {
  if (location.is_flange != (entry.use == LawUse::kPayload)) {
    field.fail(location.is_flange ? "the flange takes payloads alone"
                                  : "a payload goes to the flange: {kind: element, axis: flange}");
  }
  if (entry.use == LawUse::kInertia && !location.takes_inertia) {
    field.fail(fmt::format("inertia can't be put at {}; put it at a motor, an arm axis or a mass",
                           location.name));
  }
  const bool is_driven = location.driver >= 0;
  const bool takes_an_input =
      entry.name == "load_dependent_friction" || entry.name == "driven_viscous";
  if (location.kind == LocationKind::kElement && takes_an_input != is_driven &&
      (entry.definition.empty() || !is_driven)) {
    field.fail(
        is_driven
            ? fmt::format("'{}' is of a deflection; what is driven by an input takes "
                          "'load_dependent_friction', 'driven_viscous' or a law of one's own",
                          entry.name)
            : fmt::format("'{}' needs a location with driven_by: {{input: ...}}", entry.name));
  }
  if (location.kind != LocationKind::kElement && (entry.name == "feedthrough") != is_driven &&
      (entry.definition.empty() || !is_driven)) {
    field.fail(is_driven ? fmt::format("'{}' is of the signal itself; what is driven by another "
                                       "input takes 'feedthrough' or a law of one's own",
                                       entry.name)
                         : "'feedthrough' needs a location with driven_by: {input: ...}");
  }
  const bool is_rotation = location.units.deflection == "rad";
  const bool is_balancer = entry.name == "balancer" || entry.name == "gas_balancer";
  if (is_balancer && !is_rotation) field.fail("a balancer needs a rotation");
  if (entry.name == "gravity" && !is_rotation) {
    field.fail("gravity needs a rotation; along a line it is an offset");
  }
}

void check_range(const YamlField& value, ParameterRange range) {
  switch (range) {
    case ParameterRange::kAny:
      (void)value.number();
      break;
    case ParameterRange::kPositive:
      (void)value.positive();
      break;
    case ParameterRange::kNonNegative:
      (void)value.non_negative();
      break;
    case ParameterRange::kUnitInterval:
      if (value.number() < 0.0 || value.number() > 1.0) value.fail("must lie between 0 and 1");
      break;
  }
}

double read_parameter(const YamlField& field, const LawParameter& parameter,
                      const PlaceUnits& units) {
  const std::string expected = unit_at(parameter.unit, units);
  if (!field.is_mapping()) {
    field.fail(fmt::format("needs a value and its unit: {{value: ..., unit: {}}}", expected));
  }
  field.allow_keys({"value", "unit", "fixed"});
  const YamlField unit = field.at("unit");
  if (unit.text() != expected) {
    unit.fail(fmt::format("is '{}', must be '{}'", unit.text(), expected));
  }
  check_range(field.at("value"), parameter.range);
  return field.at("value").number();
}

bool is_left_out(const YamlField& parameters, const LawParameter& parameter) {
  return parameter.if_absent && !parameters.has(parameter.name);
}

std::vector<double> read_parameters(const YamlField& field, const LawEntry& entry,
                                    const PlaceUnits& units) {
  std::vector<double> values;
  for (const LawParameter& parameter : entry.parameters) {
    values.push_back(is_left_out(field, parameter)
                         ? *parameter.if_absent
                         : read_parameter(field.at(parameter.name), parameter, units));
  }
  for (const auto& [key, value] : field.entries()) {
    const auto known = std::ranges::find(entry.parameters, key, &LawParameter::name);
    if (known == entry.parameters.end())
      value.fail(fmt::format("is no parameter of the law '{}'", entry.name));
  }
  return values;
}

Element read_element(const YamlField& field, const Places& places) {
  field.allow_keys({"name", "location", "law", "parameters"});
  Element element;
  element.name = field.at("name").text();
  element.location = places.resolve(field.at("location"));
  const LawEntry& entry = read_law(field.at("law"), element.location);
  check_law_fits_place(field.at("law"), entry, element.location);
  element.law_name = entry.name;
  element.use = entry.use;
  element.parameters = read_parameters(field.at("parameters"), entry, element.location.units);
  const YamlField parameters = field.at("parameters");
  for (const LawParameter& parameter : entry.parameters) {
    element.fixed.push_back(is_left_out(parameters, parameter) ||
                            read_fixed(parameters.at(parameter.name)));
  }
  if (entry.make) element.law = entry.make(element.parameters);
  return element;
}

}  // namespace

Location flange_location(const std::string& load) {
  Location location;
  location.name = load.empty() ? "flange" : fmt::format("flange with load {}", load);
  location.is_flange = true;
  location.load = load;
  location.units = {"N", "m", "kg"};
  return location;
}

bool are_one_place(const Location& a, const Location& b) {
  if (a.kind != b.kind || a.is_flange != b.is_flange || a.load != b.load) return false;
  if (a.kind != LocationKind::kElement) return a.channel == b.channel;
  if (a.is_flange) return true;
  if (a.driver != b.driver) return false;
  return (a.output == b.output && a.input == b.input) ||
         (a.output == -b.output && a.input == -b.input);
}

bool read_fixed(const YamlField& parameter) {
  return parameter.has("fixed") && parameter.at("fixed").choice({"true", "false"}) == "true";
}

std::vector<Element> read_elements(const YamlField& list, const Places& places) {
  std::vector<Element> elements;
  std::set<std::string> names;
  for (const YamlField& item : list.items()) {
    elements.push_back(read_element(item, places));
    if (!names.insert(elements.back().name).second) {
      item.at("name").fail("is the name of an earlier element, too");
    }
  }
  return elements;
}

std::vector<Element> read_model_elements(const YamlField& root, const Places& places) {
  if (root.has("laws")) add_laws(root.at("laws"));
  if (!root.has("elements")) return {};
  return read_elements(root.at("elements"), places);
}

std::vector<Element> read_physics(const std::filesystem::path& file, const Places& places) {
  const YamlField root = YamlField::load(file);
  root.allow_keys({"format", "laws", "elements"});
  (void)root.at("format").choice({"graybox-physics/1"});
  (void)root.at("elements");
  return read_model_elements(root, places);
}

}  // namespace graybox
