#include "problems/mechanisms/lumped_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cctype>
#include <cmath>

#include "problems/base/error.hpp"
#include "problems/base/units.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

Eigen::Index index_of(const YamlField& field, const std::vector<std::string>& names,
                      const char* noun) {
  const std::string name = field.text();
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) {
    field.fail(fmt::format("no {} '{}'; there are {}", noun, name, fmt::join(names, ", ")));
  }
  return found - names.begin();
}

class LumpedPlaces : public Places {
 public:
  LumpedPlaces(const LumpedModel& model, PlaceUnits units)
      : model_(&model), units_(std::move(units)) {}

  [[nodiscard]] Location resolve(const YamlField& location) const override {
    const std::string kind = location.at("kind").choice({"element", "actuator", "sensor"});
    Location result;
    result.units = units_;
    if (kind == "element") {
      location.allow_keys({"kind", "mass", "between", "deflection", "driven_by"});
      result.output = result.input = deflection(location, result.name);
      result.takes_inertia = true;
      if (location.has("driven_by")) {
        drive_element(location.at("driven_by"), result);
      }
      return result;
    }
    const bool is_actuator = kind == "actuator";
    const char* noun = is_actuator ? "input" : "output";
    location.allow_keys({"kind", noun, "driven_by"});
    const auto& names = is_actuator ? model_->input_names : model_->output_names;
    const auto& units = is_actuator ? model_->input_units : model_->output_units;
    result.kind = is_actuator ? LocationKind::kActuator : LocationKind::kSensor;
    result.channel = index_of(location.at(noun), names, noun);
    const auto channel = static_cast<std::size_t>(result.channel);
    result.name = kind + " " + names[channel];
    result.units.force = units[channel];
    if (location.has("driven_by")) drive(location.at("driven_by"), result);
    return result;
  }

 private:
  // By another deflection; or by an input, and then the rate is that of the place.
  void drive_element(const YamlField& driver, Location& place) const {
    place.takes_inertia = false;
    if (driver.has("input")) {
      place.units.driver = driving_unit(driver, place);
      return;
    }
    driver.allow_keys({"mass", "between", "deflection"});
    std::string driving;
    place.input = deflection(driver, driving);
    place.name += " driven by " + driving;
  }

  std::string driving_unit(const YamlField& driver, Location& place) const {
    driver.allow_keys({"input"});
    place.driver = index_of(driver.at("input"), model_->input_names, "input");
    const auto input = static_cast<std::size_t>(place.driver);
    place.name += " driven by " + model_->input_names[input];
    return unit_below(model_->input_units[input]);
  }

  // The law is of another input than the signal: "F/x" has that input's unit below the line.
  void drive(const YamlField& driver, Location& place) const {
    place.units.deflection = driving_unit(driver, place);
    if (place.kind == LocationKind::kActuator && place.driver == place.channel) {
      driver.at("input").fail("is the signal itself");
    }
  }

  // b with z = b^T q, given in one of three ways.
  [[nodiscard]] Eigen::VectorXd deflection(const YamlField& field, std::string& name) const {
    if (field.has("mass") + field.has("between") + field.has("deflection") != 1) {
      field.fail("needs one of mass, between and deflection");
    }
    Eigen::VectorXd b = Eigen::VectorXd::Zero(model_->masses.size());
    if (field.has("mass")) {
      b(mass(field.at("mass"))) = 1.0;
      name = field.at("mass").text();
    } else if (field.has("between")) {
      const auto ends = field.at("between").items();
      if (ends.size() != 2 || ends[0].text() == ends[1].text()) {
        field.at("between").fail("must name two masses");
      }
      b(mass(ends[0])) = 1.0;
      b(mass(ends[1])) = -1.0;
      name = ends[0].text() + "-" + ends[1].text();
    } else {
      for (const auto& [key, value] : field.at("deflection").entries()) {
        const auto found = std::ranges::find(model_->mass_names, key);
        if (found == model_->mass_names.end()) {
          value.fail(
              fmt::format("no such mass; there are {}", fmt::join(model_->mass_names, ", ")));
        }
        b(found - model_->mass_names.begin()) = value.number();
        name += (name.empty() ? "" : "-") + key;
      }
      if (b.isZero(0.0)) field.at("deflection").fail("must name at least one mass");
    }
    return b;
  }
  [[nodiscard]] Eigen::Index mass(const YamlField& field) const {
    return index_of(field, model_->mass_names, "mass");
  }

  const LumpedModel* model_;
  PlaceUnits units_;
};

void read_masses(const YamlField& field, const PlaceUnits& units, LumpedModel& model) {
  std::vector<double> values;
  const char* quantity = units.inertia == "kg" ? ".mass" : ".inertia";
  for (const auto& [name, entry] : field.entries()) {
    if (std::ranges::find(model.mass_names, name) != model.mass_names.end()) {
      entry.fail("given twice");
    }
    if (entry.is_mapping()) entry.allow_keys({"value", "fixed"});
    const YamlField value = entry.is_mapping() ? entry.at("value") : entry;
    model.mass_names.push_back(name);
    values.push_back(value.non_negative());
    if (values.back() > 0.0) {
      model.parameters.push_back({name + quantity, units.inertia, values.back(),
                                  ParameterRange::kPositive,
                                  entry.is_mapping() && read_fixed(entry)});
    }
  }
  if (values.empty()) field.fail("needs at least one mass");
  const auto n = static_cast<Eigen::Index>(values.size());
  model.masses = Eigen::Map<const Eigen::VectorXd>(values.data(), n);
  model.imposed.assign(values.size(), false);
}

// Names of channels become columns of files.
std::string channel_name(const YamlField& field, const LumpedModel& model) {
  std::string name = field.text();
  const bool is_plain =
      std::ranges::all_of(name, [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; });
  if (!is_plain) field.fail("must be of letters, digits and _");
  for (const auto* names : {&model.input_names, &model.output_names}) {
    if (std::ranges::find(*names, name) != names->end()) field.fail("given twice");
  }
  return name;
}

LumpedInput::Kind input_kind(const YamlField& item) {
  using enum LumpedInput::Kind;
  const std::string kind =
      item.has("quantity")
          ? item.at("quantity").choice({"force", "position", "velocity", "acceleration", "signal"})
          : "force";
  return kind == "force"      ? kForce
         : kind == "position" ? kPosition
         : kind == "velocity" ? kVelocity
         : kind == "signal"   ? kSignal
                              : kAcceleration;
}

// Of a signal: stated, as channels have it after they are read.
std::string signal_unit(const YamlField& field) {
  const Unit* unit = find_unit(field.text());
  if (unit == nullptr) field.fail(fmt::format("is none of {}", known_unit_names()));
  if (unit->base != unit->name) {
    field.fail(fmt::format("must be the unit that recordings are converted to, {}", unit->base));
  }
  return field.text();
}

std::string unit_of(LumpedInput::Kind kind, const PlaceUnits& units) {
  switch (kind) {
    case LumpedInput::Kind::kForce:
      return units.force;
    case LumpedInput::Kind::kPosition:
      return units.deflection;
    case LumpedInput::Kind::kVelocity:
      return units.deflection + "/s";
    case LumpedInput::Kind::kAcceleration:
    case LumpedInput::Kind::kSignal:
      break;
  }
  return units.deflection + "/s^2";
}

void read_inputs(const YamlField& field, const PlaceUnits& units, LumpedModel& model) {
  const auto items = field.items();
  model.input = Eigen::MatrixXd::Zero(model.masses.size(), static_cast<Eigen::Index>(items.size()));
  for (const YamlField& item : items) {
    item.allow_keys({"name", "mass", "quantity", "unit"});
    const auto column = static_cast<Eigen::Index>(model.input_names.size());
    model.input_names.push_back(channel_name(item.at("name"), model));
    LumpedInput input{input_kind(item), 0};
    if (input.kind == LumpedInput::Kind::kSignal) {
      item.allow_keys({"name", "quantity", "unit"});
      model.input_units.push_back(signal_unit(item.at("unit")));
      model.inputs.push_back(input);
      continue;
    }
    item.allow_keys({"name", "mass", "quantity"});
    input.mass = index_of(item.at("mass"), model.mass_names, "mass");
    model.input_units.push_back(unit_of(input.kind, units));
    if (input.kind == LumpedInput::Kind::kForce) model.input(input.mass, column) = 1.0;
    if (input.kind == LumpedInput::Kind::kPosition) {
      if (model.imposed[static_cast<std::size_t>(input.mass)]) item.fail("imposed twice");
      model.imposed[static_cast<std::size_t>(input.mass)] = true;
    }
    model.inputs.push_back(input);
  }
}

// Rates of an imposed motion need the motion; a force on an imposed mass would change nothing.
void check_imposed(const YamlField& inputs, const LumpedModel& model) {
  const auto items = inputs.items();
  for (std::size_t j = 0; j < items.size(); ++j) {
    if (model.inputs[j].kind == LumpedInput::Kind::kSignal) continue;
    const bool imposed = model.imposed[static_cast<std::size_t>(model.inputs[j].mass)];
    if (model.inputs[j].kind == LumpedInput::Kind::kForce && imposed) {
      items[j].fail("acts on a mass whose motion is imposed");
    }
    if (model.inputs[j].kind != LumpedInput::Kind::kForce && !imposed) {
      items[j].fail("needs an input for the position of the same mass, too");
    }
  }
}

LumpedOutput read_element_force(const YamlField& item, const LumpedModel& model) {
  (void)item.at("quantity").choice({"force"});
  const std::string name = item.at("element").text();
  const auto found = std::ranges::find(model.parts, name, &Element::name);
  if (found == model.parts.end()) item.at("element").fail(fmt::format("no element '{}'", name));
  if (found->location.kind != LocationKind::kElement || found->use != LawUse::kForce) {
    item.at("element").fail("has no force");
  }
  return {LumpedOutput::Quantity::kElementForce, 0,
          static_cast<std::size_t>(found - model.parts.begin())};
}

LumpedOutput read_output(const YamlField& item, const LumpedModel& model) {
  using enum LumpedOutput::Quantity;
  if (item.has("element")) return read_element_force(item, model);
  const std::string quantity =
      item.at("quantity").choice({"velocity", "position", "acceleration", "force"});
  LumpedOutput output;
  output.mass = index_of(item.at("mass"), model.mass_names, "mass");
  output.quantity = quantity == "velocity"       ? kVelocity
                    : quantity == "position"     ? kPosition
                    : quantity == "acceleration" ? kAcceleration
                                                 : kForce;
  if (output.quantity == kForce && !model.imposed[static_cast<std::size_t>(output.mass)]) {
    item.fail(
        "is the force that imposes a motion: give the mass's position as an input, or name an "
        "element instead of the mass");
  }
  return output;
}

std::string unit_of(LumpedOutput::Quantity quantity, const PlaceUnits& units) {
  switch (quantity) {
    case LumpedOutput::Quantity::kPosition:
      return units.deflection;
    case LumpedOutput::Quantity::kVelocity:
      return units.deflection + "/s";
    case LumpedOutput::Quantity::kAcceleration:
      return units.deflection + "/s^2";
    case LumpedOutput::Quantity::kForce:
    case LumpedOutput::Quantity::kElementForce:
      break;
  }
  return units.force;
}

// Sensor elements name outputs, and outputs may name elements: names and units come first, what is
// measured after the elements.
void read_output_names(const YamlField& field, const PlaceUnits& units, LumpedModel& model) {
  if (field.items().empty()) field.fail("needs at least one output");
  for (const YamlField& item : field.items()) {
    item.allow_keys({"name", "mass", "element", "quantity"});
    model.output_names.push_back(channel_name(item.at("name"), model));
    const std::string quantity =
        item.at("quantity").choice({"velocity", "position", "acceleration", "force"});
    using enum LumpedOutput::Quantity;
    model.output_units.push_back(unit_of(quantity == "velocity"       ? kVelocity
                                         : quantity == "position"     ? kPosition
                                         : quantity == "acceleration" ? kAcceleration
                                                                      : kForce,
                                         units));
  }
}

void read_outputs(const YamlField& field, LumpedModel& model) {
  const auto items = field.items();
  const auto count = static_cast<Eigen::Index>(items.size());
  model.position_output = model.velocity_output = Eigen::MatrixXd::Zero(count, model.masses.size());
  for (Eigen::Index row = 0; row < count; ++row) {
    const LumpedOutput output = read_output(items[static_cast<std::size_t>(row)], model);
    using enum LumpedOutput::Quantity;
    if (output.quantity == kPosition) model.position_output(row, output.mass) = 1.0;
    if (output.quantity == kVelocity) model.velocity_output(row, output.mass) = 1.0;
    model.outputs.push_back(output);
  }
}

void read_noise(const YamlField& field, LumpedModel& model) {
  for (const auto& [name, value] : field.entries()) {
    const auto found = std::ranges::find(model.output_names, name);
    if (found == model.output_names.end()) {
      value.fail(fmt::format("no such output; there are {}", fmt::join(model.output_names, ", ")));
    }
    model.noise(found - model.output_names.begin()) = value.non_negative();
  }
}

// M, C and K from masses and linear elements; the others are kept.
void build(LumpedModel& model) {
  model.mass = model.masses.asDiagonal();
  const auto n = model.masses.size();
  model.damping = model.stiffness = Eigen::MatrixXd::Zero(n, n);
  model.elements.clear();
  for (const Element& element : model.parts) {
    const Location& place = element.location;
    const bool is_force = place.kind == LocationKind::kElement;
    if (element.use == LawUse::kInertia) {
      model.mass += element.parameters[0] * place.output * place.output.transpose();
    } else if (is_force && element.law_name == "stiffness") {
      model.stiffness += element.parameters[0] * place.output * place.input.transpose();
    } else if (is_force && element.law_name == "viscous") {
      model.damping += element.parameters[0] * place.output * place.input.transpose();
    } else {
      model.elements.push_back(element);
    }
  }
}

bool moves_with_inertia(const LumpedModel& model) {
  Eigen::MatrixXd free = model.mass;
  for (std::size_t i = 0; i < model.imposed.size(); ++i) {
    if (!model.imposed[i]) continue;
    const auto k = static_cast<Eigen::Index>(i);
    free.row(k).setZero();
    free.col(k).setZero();
    free(k, k) = 1.0;
  }
  return Eigen::LLT<Eigen::MatrixXd>(free).info() == Eigen::Success;
}

const LawEntry& law_of(const Element& element) {
  return *find_law(element.law_name, element.location.kind != LocationKind::kElement);
}

void add_parts(std::vector<Element> elements, LumpedModel& model) {
  for (Element& element : elements) {
    const LawEntry& law = law_of(element);
    for (std::size_t i = 0; i < law.parameters.size(); ++i) {
      const LawParameter& parameter = law.parameters[i];
      model.parameters.push_back({element.name + "." + parameter.name,
                                  unit_at(parameter.unit, element.location.units),
                                  element.parameters[i], parameter.range, element.fixed[i]});
    }
    model.parts.push_back(std::move(element));
  }
}

// An imposed motion is what was measured: a law would have to change its rates, too.
void check_actuators(const LumpedModel& model) {
  for (const Element& part : model.parts) {
    if (part.location.kind != LocationKind::kActuator) continue;
    const auto input = static_cast<std::size_t>(part.location.channel);
    using enum LumpedInput::Kind;
    if (model.inputs[input].kind == kForce || model.inputs[input].kind == kSignal) continue;
    throw InputError(
        fmt::format("element '{}': the input '{}' imposes a motion, which takes no laws; put the "
                    "law at the sensor of an output",
                    part.name, model.input_names[input]));
  }
}

// `parameters: [...]` names those that are not known.
void read_free_parameters(const YamlField& field, LumpedModel& model) {
  for (LumpedParameter& parameter : model.parameters) parameter.fixed = true;
  for (const YamlField& item : field.items()) {
    const std::string name = item.text();
    const auto found = std::ranges::find(model.parameters, name, &LumpedParameter::name);
    if (found == model.parameters.end()) {
      std::vector<std::string> names;
      for (const LumpedParameter& parameter : model.parameters) names.push_back(parameter.name);
      item.fail(fmt::format("no parameter '{}'; there are {}", name, fmt::join(names, ", ")));
    }
    found->fixed = false;
  }
}

bool is_within(double value, ParameterRange range) {
  switch (range) {
    case ParameterRange::kPositive:
      return value > 0.0;
    case ParameterRange::kNonNegative:
      return value >= 0.0;
    case ParameterRange::kUnitInterval:
      return value >= 0.0 && value <= 1.0;
    case ParameterRange::kAny:
      break;
  }
  return std::isfinite(value);
}

}  // namespace

bool LumpedModel::has_imposed_motion() const {
  return std::ranges::find(imposed, true) != imposed.end();
}

bool LumpedModel::is_driven_by_forces_alone() const {
  const auto is_force = [](const LumpedInput& each) {
    return each.kind == LumpedInput::Kind::kForce;
  };
  const auto is_driven = [](const Element& part) { return part.location.driver >= 0; };
  return std::ranges::all_of(inputs, is_force) && std::ranges::none_of(parts, is_driven);
}

LumpedModel load_lumped_model(const std::filesystem::path& file,
                              const std::optional<std::filesystem::path>& physics) {
  const YamlField root = YamlField::load(file);
  (void)root.at("format").choice({"graybox-lumped/1"});
  root.allow_keys({"format", "sample_time", "motion", "masses", "laws", "elements", "inputs",
                   "outputs", "noise", "controller", "parameters"});
  const bool rotates = root.at("motion").choice({"rotation", "translation"}) == "rotation";
  const PlaceUnits units =
      rotates ? PlaceUnits{"N m", "rad", "kg m^2"} : PlaceUnits{"N", "m", "kg"};
  LumpedModel model;
  model.name = file.stem().string();
  const YamlField sample_time = root.at("sample_time");
  model.sample_time = sample_time.text() == "unknown" ? 1.0 : sample_time.positive();
  read_masses(root.at("masses"), units, model);
  model.input = Eigen::MatrixXd::Zero(model.masses.size(), 0);
  if (root.has("inputs")) {  // none: it moves by itself
    read_inputs(root.at("inputs"), units, model);
    check_imposed(root.at("inputs"), model);
  }
  for (const auto& [name, value] : root.at("masses").entries()) {
    const Eigen::Index mass = std::ranges::find(model.mass_names, name) - model.mass_names.begin();
    if (model.masses(mass) == 0.0 && !model.imposed[static_cast<std::size_t>(mass)]) {
      value.fail("must be positive, or its motion imposed by an input");
    }
  }
  read_output_names(root.at("outputs"), units, model);
  model.noise = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(model.output_names.size()));
  if (root.has("noise")) read_noise(root.at("noise"), model);
  if (root.has("controller")) {
    const YamlField field = root.at("controller");
    if (model.input_names.size() != model.output_names.size()) {
      field.fail("needs as many outputs as inputs");
    }
    model.controller = read_pi_controller(field, model.input_names.size());
  }
  model.mass = Eigen::MatrixXd::Zero(model.masses.size(), model.masses.size());
  const LumpedPlaces places(model, units);
  add_parts(read_model_elements(root, places), model);
  if (physics) add_parts(read_physics(*physics, places), model);
  check_actuators(model);
  read_outputs(root.at("outputs"), model);
  if (root.has("parameters")) read_free_parameters(root.at("parameters"), model);
  build(model);
  if (!moves_with_inertia(model)) {
    throw InputError(fmt::format("{}: elements: negative inertia leaves a mass none",
                                 physics.value_or(file).string()));
  }
  return model;
}

std::unique_ptr<Places> lumped_places(const LumpedModel& model, PlaceUnits units) {
  return std::make_unique<LumpedPlaces>(model, std::move(units));
}

LumpedModel with_parameters(const LumpedModel& model, std::span<const double> values) {
  LumpedModel changed = model;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!is_within(values[i], model.parameters[i].range)) {
      throw InputError(fmt::format("{}: {} is out of range", model.parameters[i].name, values[i]));
    }
    changed.parameters[i].value = values[i];
  }
  std::size_t next = 0;
  for (Eigen::Index i = 0; i < model.masses.size(); ++i) {
    if (model.masses(i) != 0.0) changed.masses(i) = values[next++];
  }
  for (Element& element : changed.parts) {
    for (double& parameter : element.parameters) parameter = values[next++];
    const LawEntry& law = law_of(element);
    if (law.make) element.law = law.make(element.parameters);
  }
  build(changed);
  return changed;
}

}  // namespace graybox
