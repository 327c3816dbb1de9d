#include "graybox/problems/elements/lumped_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cctype>

#include "graybox/problems/error.hpp"

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
        const YamlField driver = location.at("driven_by");
        driver.allow_keys({"mass", "between", "deflection"});
        std::string driving;
        result.input = deflection(driver, driving);
        result.name += " driven by " + driving;
        result.takes_inertia = false;
      }
      return result;
    }
    const bool is_actuator = kind == "actuator";
    const char* noun = is_actuator ? "input" : "output";
    location.allow_keys({"kind", noun});
    const auto& names = is_actuator ? model_->input_names : model_->output_names;
    const auto& units = is_actuator ? model_->input_units : model_->output_units;
    result.kind = is_actuator ? LocationKind::kActuator : LocationKind::kSensor;
    result.channel = index_of(location.at(noun), names, noun);
    const auto channel = static_cast<std::size_t>(result.channel);
    result.name = kind + " " + names[channel];
    result.units.force = units[channel];
    return result;
  }

 private:
  // b with z = b^T q, given in one of three ways.
  [[nodiscard]] Eigen::VectorXd deflection(const YamlField& field, std::string& name) const {
    if (field.has("mass") + field.has("between") + field.has("deflection") != 1) {
      field.fail("needs one of mass, between and deflection");
    }
    Eigen::VectorXd b = Eigen::VectorXd::Zero(model_->mass.rows());
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

void read_masses(const YamlField& field, LumpedModel& model) {
  std::vector<double> values;
  for (const auto& [name, value] : field.entries()) {
    if (std::ranges::find(model.mass_names, name) != model.mass_names.end()) {
      value.fail("given twice");
    }
    model.mass_names.push_back(name);
    values.push_back(value.positive());
  }
  if (values.empty()) field.fail("needs at least one mass");
  const auto n = static_cast<Eigen::Index>(values.size());
  model.mass = Eigen::Map<const Eigen::VectorXd>(values.data(), n).asDiagonal();
  model.damping = model.stiffness = Eigen::MatrixXd::Zero(n, n);
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

void read_inputs(const YamlField& field, const PlaceUnits& units, LumpedModel& model) {
  const auto items = field.items();
  if (items.empty()) field.fail("needs at least one input");
  model.input = Eigen::MatrixXd::Zero(model.mass.rows(), static_cast<Eigen::Index>(items.size()));
  for (const YamlField& item : items) {
    item.allow_keys({"name", "mass"});
    const auto column = static_cast<Eigen::Index>(model.input_names.size());
    model.input_names.push_back(channel_name(item.at("name"), model));
    model.input_units.push_back(units.force);
    model.input(index_of(item.at("mass"), model.mass_names, "mass"), column) = 1.0;
  }
}

void read_outputs(const YamlField& field, const PlaceUnits& units, LumpedModel& model) {
  const auto items = field.items();
  if (items.empty()) field.fail("needs at least one output");
  const auto count = static_cast<Eigen::Index>(items.size());
  model.position_output = model.velocity_output = Eigen::MatrixXd::Zero(count, model.mass.rows());
  for (const YamlField& item : items) {
    item.allow_keys({"name", "mass", "quantity"});
    const auto row = static_cast<Eigen::Index>(model.output_names.size());
    model.output_names.push_back(channel_name(item.at("name"), model));
    const bool is_velocity = item.at("quantity").choice({"velocity", "position"}) == "velocity";
    model.output_units.push_back(units.deflection + (is_velocity ? "/s" : ""));
    (is_velocity ? model.velocity_output : model.position_output)(
        row, index_of(item.at("mass"), model.mass_names, "mass")) = 1.0;
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

void build_in(LumpedModel& model, std::vector<Element> elements) {
  for (Element& element : elements) {
    const Location& place = element.location;
    const bool is_force = place.kind == LocationKind::kElement;
    if (element.use == LawUse::kInertia) {
      model.mass += element.parameters[0] * place.output * place.output.transpose();
    } else if (is_force && element.law_name == "stiffness") {
      model.stiffness += element.parameters[0] * place.output * place.input.transpose();
    } else if (is_force && element.law_name == "viscous") {
      model.damping += element.parameters[0] * place.output * place.input.transpose();
    } else {
      model.elements.push_back(std::move(element));
    }
  }
}

}  // namespace

LumpedModel load_lumped_model(const std::filesystem::path& file,
                              const std::optional<std::filesystem::path>& physics) {
  const YamlField root = YamlField::load(file);
  (void)root.at("format").choice({"graybox-lumped/1"});
  root.allow_keys({"format", "sample_time", "motion", "masses", "elements", "inputs", "outputs",
                   "noise", "controller"});
  const bool rotates = root.at("motion").choice({"rotation", "translation"}) == "rotation";
  const PlaceUnits units =
      rotates ? PlaceUnits{"N m", "rad", "kg m^2"} : PlaceUnits{"N", "m", "kg"};
  LumpedModel model;
  model.name = file.stem().string();
  model.sample_time = root.at("sample_time").positive();
  read_masses(root.at("masses"), model);
  read_inputs(root.at("inputs"), units, model);
  read_outputs(root.at("outputs"), units, model);
  model.noise = Eigen::VectorXd::Zero(model.velocity_output.rows());
  if (root.has("noise")) read_noise(root.at("noise"), model);
  if (root.has("controller")) {
    const YamlField field = root.at("controller");
    if (model.input_names.size() != model.output_names.size()) {
      field.fail("needs as many outputs as inputs");
    }
    model.controller = read_pi_controller(field, model.input_names.size());
  }
  const LumpedPlaces places(model, units);
  if (root.has("elements")) build_in(model, read_elements(root.at("elements"), places));
  if (physics) build_in(model, read_physics(*physics, places));
  if (Eigen::LLT<Eigen::MatrixXd>(model.mass).info() != Eigen::Success) {
    throw InputError(fmt::format("{}: elements: negative inertia leaves a mass none",
                                 physics.value_or(file).string()));
  }
  return model;
}

}  // namespace graybox
