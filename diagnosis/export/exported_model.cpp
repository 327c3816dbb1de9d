#include "diagnosis/export/exported_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "diagnosis/export/law_source.hpp"
#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "problems/base/error.hpp"
#include "problems/files/environment_text.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

using Eigen::Index;

// What became of the names in `without`.
class LeftOut {
 public:
  LeftOut(const std::filesystem::path& file, const std::vector<std::string>& names)
      : file_(file.string()), names_(names), found_(names.size()) {}

  bool operator()(const Element& element) {
    present_.push_back("'" + element.name + "'");
    const auto name = std::ranges::find(names_, element.name);
    if (name == names_.end()) return false;
    found_[static_cast<std::size_t>(name - names_.begin())] = true;
    return true;
  }

  void require_all() const {
    const auto missing = std::ranges::find(found_, false);
    if (missing == found_.end()) return;
    throw InputError(
        fmt::format("{}: --without: no element '{}'; there are {}", file_,
                    names_[static_cast<std::size_t>(missing - found_.begin())],
                    present_.empty() ? "none" : fmt::format("{}", fmt::join(present_, ", "))));
  }

 private:
  std::string file_;
  const std::vector<std::string>& names_;
  std::vector<bool> found_;
  std::vector<std::string> present_;
};

// ---- lumped models ------------------------------------------------------------------------------

void take_element(const Element& element, ExportedModel& result) {
  const Location& place = element.location;
  if (place.kind == LocationKind::kActuator) {
    result.commands.push_back(element);
  } else if (place.kind == LocationKind::kSensor) {
    result.senses.push_back(element);
  } else if (element.use == LawUse::kInertia) {
    result.mass += element.parameters[0] * place.output * place.input.transpose();
  } else {
    result.forces.push_back(element);
  }
}

ExportedModel lumped(const std::filesystem::path& file, const ExportOptions& options) {
  if (options.physics.size() > 1) {
    throw InputError("--physics: a lumped model takes one file of further elements");
  }
  if (!options.load.empty()) {
    throw InputError(
        fmt::format("--load: {} is a lumped model; loads are for robots", file.string()));
  }
  std::optional<std::filesystem::path> physics;
  if (!options.physics.empty()) physics = options.physics.front();
  const LumpedModel model = load_lumped_model(file, physics);
  ExportedModel result;
  result.file = file;
  const bool turns = YamlField::load(file).at("motion").text() == "rotation";
  const PlaceUnits units =
      turns ? PlaceUnits{.force = "N m", .deflection = "rad", .inertia = "kg m^2"}
            : PlaceUnits{.force = "N", .deflection = "m", .inertia = "kg"};
  for (std::size_t i = 0; i < model.mass_names.size(); ++i) {
    result.coordinates.push_back({.name = model.mass_names[i], .units = units});
    result.numbers.push_back({.owner = model.mass_names[i],
                              .name = turns ? "inertia" : "mass",
                              .value = model.masses(static_cast<Index>(i)),
                              .unit = units.inertia});
  }
  result.mass = model.masses.asDiagonal();
  LeftOut is_left_out(file, options.without);
  for (const Element& part : model.parts) {
    if (!is_left_out(part)) take_element(part, result);
  }
  is_left_out.require_all();
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    if (model.inputs[i].kind != LumpedInput::Kind::kForce) continue;
    result.input_names.push_back(model.input_names[i]);
    result.input_channels.push_back(static_cast<Index>(i));
    result.input_masses.push_back(model.inputs[i].mass);
  }
  return result;
}

// ---- rigid robots -------------------------------------------------------------------------------

// The values of `base_parameters` by the names of TorqueColumns.
class BaseParameterList {
 public:
  BaseParameterList(const YamlField& root, const RigidRobotModel& robot) {
    if (!root.has("base_parameters")) return;
    for (const YamlField& item : root.at("base_parameters").items()) {
      take(item, robot);
    }
  }

  [[nodiscard]] bool empty() const { return values_.empty(); }

  // Zero for a parameter that is regrouped into another, or has no effect.
  [[nodiscard]] double value(const std::string& name) const {
    const auto found = std::ranges::find(values_, name, &std::pair<std::string, double>::first);
    return found == values_.end() ? 0.0 : found->second;
  }
  // Added to the stated bodies (10 x n) where a diagnosis has freed them.
  [[nodiscard]] const Eigen::MatrixXd& departures() const { return departures_; }
  void require_all_used(const YamlField& root, const std::vector<std::string>& known) const {
    for (const auto& [name, value] : values_) {
      if (std::ranges::find(known, name) != known.end()) continue;
      root.at("base_parameters")
          .fail(fmt::format("'{}' is no unknown parameter of this model; diagnose anew", name));
    }
  }

 private:
  void take(const YamlField& item, const RigidRobotModel& robot) {
    std::string name = item.at("name").text();
    const double value = item.at("value").number();
    if (departures_.size() == 0) {
      departures_ = Eigen::MatrixXd::Zero(kStandardParameters, robot.size());
    }
    const std::string between = " departure of ";
    if (const std::size_t at = name.find(between); at != std::string::npos) {
      const auto own = std::ranges::find(kStandardParameterNames, name.substr(0, at));
      const auto joint =
          std::ranges::find(robot.joints, name.substr(at + between.size()), &RobotJoint::name);
      if (own == kStandardParameterNames.end() || joint == robot.joints.end()) {
        item.at("name").fail("names no parameter of a body of this model");
      }
      departures_(own - kStandardParameterNames.begin(), joint - robot.joints.begin()) = value;
      return;
    }
    if (name.ends_with("R")) name.pop_back();  // others are regrouped into it
    values_.emplace_back(name, value);
  }

  std::vector<std::pair<std::string, double>> values_;
  Eigen::MatrixXd departures_;
};

void refuse_unknown(const std::filesystem::path& file, const RigidRobotModel& robot, bool is_told) {
  std::vector<std::string> unknown;
  for (const RobotJoint& joint : robot.joints) {
    if (is_told) break;
    if (!joint.body) unknown.push_back("the body of " + joint.name);
    if (!joint.rotor_inertia) unknown.push_back("the rotor inertia of " + joint.name);
  }
  if (robot.channels.unknown_drive_gains) unknown.emplace_back("the gains of the drives");
  if (unknown.empty()) return;
  const bool is_one = unknown.size() == 1 && !robot.channels.unknown_drive_gains;
  throw InputError(fmt::format(
      "{}: {} {} unknown, and a program needs numbers: {}", file.string(), fmt::join(unknown, ", "),
      is_one ? "is" : "are",
      robot.channels.unknown_drive_gains
          ? "state the torque constants in the campaign, and drive_gains: known"
          : "state them, or export the model_extended.yaml that graybox diagnose writes"));
}

// Bodies: those stated, or the equivalent ones of the base parameters.
void take_bodies(const BaseParameterList& base, ExportedModel& result) {
  const RigidRobotModel& robot = *result.robot;
  result.bodies = Eigen::MatrixXd::Zero(kStandardParameters, robot.size());
  constexpr std::array<const char*, 10> kUnits = {"kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2",
                                                  "kg m^2", "kg m",   "kg m",   "kg m",   "kg"};
  for (Index j = 0; j < robot.size(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    if (joint.body) result.bodies.col(j) = standard_parameters(*joint.body);
    if (joint.body && base.departures().size() > 0)
      result.bodies.col(j) += base.departures().col(j);
    for (Index k = 0; k < kStandardParameters; ++k) {
      const auto own = static_cast<std::size_t>(k);
      if (!joint.body) {
        result.bodies(k, j) = base.value(fmt::format("{}{}", kStandardParameterNames[own], j + 1));
      }
      result.numbers.push_back({.owner = joint.name,
                                .name = std::string(kStandardParameterNames[own]),
                                .value = result.bodies(k, j),
                                .unit = kUnits[own]});
    }
  }
}

void take_rotors(const BaseParameterList& base, ExportedModel& result) {
  const RigidRobotModel& robot = *result.robot;
  result.mass = Eigen::MatrixXd::Zero(robot.size(), robot.size());
  for (Index j = 0; j < robot.size(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    const double inertia =
        joint.rotor_inertia.value_or(base.value(fmt::format("rotor_inertia_{}", j + 1)));
    const Eigen::VectorXd row = robot.transmission.row(j);
    result.mass += inertia * row * row.transpose();
    result.numbers.push_back({.owner = joint.name,
                              .name = "rotor_inertia",
                              .value = inertia,
                              .unit = joint.is_prismatic ? "kg" : "kg m^2"});
  }
}

// Parameters of elements that are regrouped have their values in the list.
Element with_base_values(Element element, const BaseParameterList& base) {
  if (base.empty()) return element;
  const LawEntry& law = law_entry(element);
  for (std::size_t p = 0; p < law.parameters.size(); ++p) {
    const double value = base.value(element.name + "." + law.parameters[p].name);
    if (value != 0.0) element.parameters[p] = value;
  }
  if (element.law) element.law = law.make(element.parameters);
  return element;
}

// A payload is a point mass on the last link.
void take_payload(const Element& element, const std::string& load, ExportedModel& result) {
  if (!element.location.load.empty() && element.location.load != load) return;
  const std::vector<double>& values = element.parameters;
  const Eigen::Vector3d place =
      result.robot->flange * Eigen::Vector3d(values[1], values[2], values[3]);
  result.bodies.col(result.size() - 1) +=
      standard_parameters({values[0], place, Eigen::Matrix3d::Zero()});
}

void require_load(const std::filesystem::path& file, const RigidRobotModel& robot,
                  const std::string& load) {
  if (load.empty()) return;
  std::vector<std::string> loads;
  for (const Element& element : robot.elements) {
    if (!element.location.load.empty()) loads.push_back(element.location.load);
  }
  if (std::ranges::find(loads, load) != loads.end()) return;
  throw InputError(fmt::format("{}: --load: no payload of the load '{}'; there are {}",
                               file.string(), load,
                               loads.empty() ? "none" : fmt::format("{}", fmt::join(loads, ", "))));
}

// Every name that TorqueColumns gives a parameter of this model.
std::vector<std::string> parameter_names(const RigidRobotModel& robot) {
  RigidRobotModel all = robot;
  all.known.clear();
  return TorqueColumns(all).names();
}

ExportedModel rigid_robot(const std::filesystem::path& file, const ExportOptions& options) {
  const YamlField root = YamlField::load(file);
  ExportedModel result;
  result.file = file;
  result.robot = load_rigid_robot(file, options.physics);
  const RigidRobotModel& robot = *result.robot;
  const BaseParameterList base(root, robot);
  refuse_unknown(file, robot, root.has("base_parameters"));
  base.require_all_used(root, parameter_names(robot));
  require_load(file, robot, options.load);
  for (const RobotJoint& joint : robot.joints) {
    result.has_base_parameters |= !joint.body || !base.departures().isZero(0.0);
    result.coordinates.push_back(
        {.name = joint.name,
         .units = joint.is_prismatic
                      ? PlaceUnits{.force = "N", .deflection = "m", .inertia = "kg"}
                      : PlaceUnits{.force = "N m", .deflection = "rad", .inertia = "kg m^2"}});
  }
  take_bodies(base, result);
  take_rotors(base, result);
  LeftOut is_left_out(file, options.without);
  for (const Element& stated : robot.elements) {
    const Element element = with_base_values(stated, base);
    if (is_left_out(element)) continue;
    if (element.use == LawUse::kPayload) {
      take_payload(element, options.load, result);
      if (element.location.load.empty() || element.location.load == options.load) {
        result.payloads.push_back(element);
      }
    } else {
      if (element.use == LawUse::kInertia) result.inertias.push_back(element);
      take_element(element, result);
    }
  }
  is_left_out.require_all();
  if (root.has("urdf")) {
    result.urdf = file.parent_path() / with_environment(root.at("urdf"));
    result.base = root.at("base").text();
    result.tip = root.at("tip").text();
  }
  return result;
}

// ---- what can't be exported ---------------------------------------------------------------------

bool can_be_undone(const Element& element) {
  constexpr std::string_view kUndone[] = {"gain", "offset", "saturation", "dead_zone"};
  return std::ranges::find(kUndone, element.law_name) != std::end(kUndone) &&
         element.location.driver < 0 && law_entry(element).definition.empty() &&
         !(element.law_name == "gain" && element.parameters[0] <= -1.0);
}

}  // namespace

const LawEntry& law_entry(const Element& element) {
  return *find_law(element.law_name, element.location.kind != LocationKind::kElement);
}

std::string element_words(const Element& element) {
  return fmt::format("'{}' ({} at {})", element.name, element.law_name, element.location.name);
}

void refuse_export(const ExportedModel& model, const std::vector<std::string>& obstacles) {
  throw InputError(fmt::format("{}: {}; --without 'NAME' leaves an element out",
                               model.file.string(), fmt::join(obstacles, "; ")));
}

void require_closed_forces(const ExportedModel& model) {
  std::vector<std::string> obstacles;
  for (const Element& element : model.forces) {
    if (element.law && element.law->state_count() > 0) {
      obstacles.push_back(fmt::format(
          "element {} has memory: its force follows from the motion before, not from position, "
          "velocity and acceleration (put coulomb or stribeck in its place)",
          element_words(element)));
    } else if (element.location.driver >= 0) {
      obstacles.push_back(fmt::format(
          "element {} is driven by an input, which the function does not get (put coulomb with "
          "the level at a usual load in its place)",
          element_words(element)));
    } else if (!law_source(law_entry(element))) {
      obstacles.push_back(
          fmt::format("element {} has no force that can be written in C", element_words(element)));
    }
  }
  for (const Element& element : model.commands) {
    if (can_be_undone(element)) continue;
    obstacles.push_back(fmt::format(
        "element {} is a law of an actuator that no formula undoes ({})", element_words(element),
        element.use == LawUse::kDelay || element.law_name == "lag"
            ? "move the reference ahead by that time"
            : "mend the actuator's signal where it is made"));
  }
  if (!obstacles.empty()) refuse_export(model, obstacles);
}

ExportedModel read_exported_model(const std::filesystem::path& file, const ExportOptions& options) {
  const YamlField format = YamlField::load(file).at("format");
  const std::string name = format.text();
  if (name == "graybox-lumped/1") return lumped(file, options);
  if (name == "graybox-rigid-robot/1") return rigid_robot(file, options);
  format.fail(fmt::format(
      "is '{}'; graybox-lumped/1 and graybox-rigid-robot/1 models can be exported{}", name,
      name == "graybox-robot/1"
          ? " (between a flexible robot's motors and arm are springs: no force follows from the "
            "motion of its joints alone; describe it as a rigid robot)"
          : ""));
}

}  // namespace graybox
