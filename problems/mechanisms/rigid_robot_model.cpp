#include "problems/mechanisms/rigid_robot_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <numbers>
#include <set>

#include "problems/base/error.hpp"
#include "problems/files/environment_text.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/mechanisms/urdf_chain.hpp"

namespace graybox {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Index = Eigen::Index;

constexpr double kDegree = std::numbers::pi / 180.0;
const std::string kUnknown = "unknown";

bool is_unknown(const YamlField& field) {
  return !field.is_list() && !field.is_mapping() && field.text() == kUnknown;
}

Vector3d read_vector(const YamlField& field) {
  const std::vector<double> values = field.numbers(3);
  return {values[0], values[1], values[2]};
}

// ---- bodies -------------------------------------------------------------------------------------

Eigen::Matrix3d read_inertia(const YamlField& field) {
  field.allow_keys({"xx", "yy", "zz", "xy", "xz", "yz"});
  const auto entry = [&](const char* key) { return field.at(key).number(); };
  // Read first: an exception among the commas of an Eigen matrix ends a debug build.
  const double xx = entry("xx"), yy = entry("yy"), zz = entry("zz");
  const double xy = entry("xy"), xz = entry("xz"), yz = entry("yz");
  Eigen::Matrix3d inertia;
  inertia << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia, Eigen::EigenvaluesOnly);
  if (solver.eigenvalues()(0) < -1e-9 * std::abs(solver.eigenvalues()(2))) {
    field.fail("has a negative principal moment; give it about the centre of mass");
  }
  return inertia;
}

RigidBody read_body(const YamlField& field) {
  field.allow_keys({"mass", "centre_of_mass", "inertia"});
  RigidBody body;
  body.mass = field.at("mass").non_negative();
  body.centre_of_mass = read_vector(field.at("centre_of_mass"));
  if (field.has("inertia")) body.inertia = read_inertia(field.at("inertia"));
  return body;
}

// ---- joints -------------------------------------------------------------------------------------

struct Drive {
  double gear_ratio = 1.0;
  std::optional<double> rotor_inertia;
};

Drive read_drive(const YamlField& field, bool has_transmission) {
  Drive drive;
  if (has_transmission) {
    if (field.has("gear_ratio")) {
      field.at("gear_ratio").fail("the transmission matrix replaces the gear ratios: give one");
    }
  } else {
    drive.gear_ratio = field.at("gear_ratio").number();
    if (drive.gear_ratio == 0.0) field.at("gear_ratio").fail("must not be zero");
  }
  const YamlField inertia = field.at("rotor_inertia");
  if (!is_unknown(inertia)) drive.rotor_inertia = inertia.non_negative();
  return drive;
}

// The constant parts of a row: Trans_z(d) Rot_z(theta) stay with the joint's axis, which they keep,
// Rot_x(alpha) Trans_x(a) come before (modified) or after it (standard).
struct Row {
  Isometry3d along_axis;
  Isometry3d across;
};

Row read_row(const YamlField& field) {
  Row row;
  const double theta = field.has("theta") ? field.at("theta").number() * kDegree : 0.0;
  row.along_axis = Eigen::Translation3d(0.0, 0.0, field.at("d").number()) *
                   Eigen::AngleAxisd(theta, Vector3d::UnitZ());
  row.across = Eigen::AngleAxisd(field.at("alpha").number() * kDegree, Vector3d::UnitX()) *
               Eigen::Translation3d(field.at("a").number(), 0.0, 0.0);
  return row;
}

// A standard row's frame stands beyond the joint: its body moves to the joint's frame, and the rest
// of the row goes before the next joint.
void read_rows(const YamlField& list, bool is_modified, bool has_transmission,
               RigidRobotModel& model) {
  Isometry3d before = Isometry3d::Identity();
  for (const YamlField& item : list.items()) {
    item.allow_keys(
        {"name", "type", "a", "alpha", "d", "theta", "gear_ratio", "rotor_inertia", "body"});
    RobotJoint joint;
    joint.name = item.at("name").text();
    joint.is_prismatic =
        item.has("type") && item.at("type").choice({"revolute", "prismatic"}) == "prismatic";
    const Row row = read_row(item);
    joint.origin = is_modified ? row.across * row.along_axis : before * row.along_axis;
    before = row.across;
    if (item.has("body") && !is_unknown(item.at("body"))) {
      joint.body = read_body(item.at("body"));
      if (!is_modified) joint.body = moved(*joint.body, row.across);
    }
    const Drive drive = read_drive(item, has_transmission);
    joint.rotor_inertia = drive.rotor_inertia;
    model.transmission.conservativeResize(model.size() + 1, 1);
    model.transmission(model.size(), 0) = drive.gear_ratio;
    model.joints.push_back(std::move(joint));
  }
  if (model.joints.empty()) list.fail("needs at least one joint");
  if (!is_modified) model.flange = before;
}

LockedJoints read_locked(const YamlField& root) {
  LockedJoints locked;
  if (!root.has("locked")) return locked;
  for (const auto& [name, place] : root.at("locked").entries()) locked[name] = place.number();
  return locked;
}

void read_urdf(const YamlField& root, const std::filesystem::path& folder, bool has_transmission,
               RigidRobotModel& model) {
  const std::string urdf = with_environment(root.at("urdf"));
  const UrdfChain urdf_chain = read_urdf_joints(folder / urdf, root.at("base").text(),
                                                root.at("tip").text(), read_locked(root));
  const std::vector<ChainRotation>& chain = urdf_chain.joints;
  const std::vector<YamlField> items = root.at("joints").items();
  for (std::size_t k = 0; k < std::min(items.size(), chain.size()); ++k) {
    const YamlField& item = items[k];
    item.allow_keys({"name", "gear_ratio", "rotor_inertia", "body"});
    const ChainRotation& rotation = chain[k];
    if (item.at("name").text() != rotation.name) {
      item.at("name").fail(
          fmt::format("the joint at this place in {} is '{}'", urdf, rotation.name));
    }
    RobotJoint joint;
    joint.name = rotation.name;
    joint.origin = rotation.origin;
    joint.axis = rotation.axis.normalized();
    joint.is_prismatic = urdf_chain.is_prismatic[k];
    if (!item.has("body")) {
      joint.body = rotation.body;
    } else if (!is_unknown(item.at("body"))) {
      item.at("body").fail("comes from the URDF: leave it out, or write 'unknown'");
    }
    const Drive drive = read_drive(item, has_transmission);
    joint.rotor_inertia = drive.rotor_inertia;
    model.transmission.conservativeResize(model.size() + 1, 1);
    model.transmission(model.size(), 0) = drive.gear_ratio;
    model.joints.push_back(std::move(joint));
  }
  if (items.size() != chain.size()) {
    root.at("joints").fail(fmt::format("has {} joints, but {} has {} between base and tip",
                                       items.size(), urdf, chain.size()));
  }
}

Eigen::MatrixXd read_transmission(const YamlField& field, Index size) {
  const std::vector<YamlField> rows = field.items();
  if (static_cast<Index>(rows.size()) != size) {
    field.fail(fmt::format("must have {} rows, one a motor; has {}", size, rows.size()));
  }
  Eigen::MatrixXd matrix(size, size);
  for (Index i = 0; i < size; ++i) {
    const std::vector<double> row =
        rows[static_cast<std::size_t>(i)].numbers(static_cast<std::size_t>(size));
    matrix.row(i) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), size);
  }
  if (!Eigen::FullPivLU<Eigen::MatrixXd>(matrix).isInvertible()) {
    field.fail("must be invertible: every joint needs a motor of its own");
  }
  return matrix;
}

void check_names(const YamlField& joints, const RigidRobotModel& model) {
  std::set<std::string> names;
  for (const RobotJoint& joint : model.joints) {
    if (!names.insert(joint.name).second) {
      joints.fail(fmt::format("'{}' is the name of two joints", joint.name));
    }
  }
}

// ---- elements -----------------------------------------------------------------------------------

class RigidRobotPlaces : public Places {
 public:
  explicit RigidRobotPlaces(const RigidRobotModel& model) : model_(&model) {}

  [[nodiscard]] Location resolve(const YamlField& location) const override {
    const std::string kind = location.at("kind").choice({"element", "actuator", "sensor"});
    if (kind != "element") {
      location.at("kind").fail("must be 'element': inverse dynamics has no laws of signals");
    }
    Location result;
    if (location.has("axis") && location.at("axis").text() == "flange") {
      location.allow_keys({"kind", "axis", "load"});
      return flange_location(location.has("load") ? location.at("load").text() : "");
    }
    location.allow_keys({"kind", "joint", "axis", "deflection", "driven_by", "load"});
    result.takes_inertia = true;
    result.output = result.input = deflection(location, result);
    if (location.has("driven_by")) {
      const YamlField driver = location.at("driven_by");
      driver.allow_keys({"joint", "axis", "deflection"});
      Location driving;
      result.input = deflection(driver, driving);
      result.name += " driven by " + driving.name;
      result.takes_inertia = false;
      if (driving.units.deflection != result.units.deflection) {
        driver.fail(fmt::format("moves in {}, the element in {}: they must be of one kind",
                                driving.units.deflection, result.units.deflection));
      }
    }
    if (location.has("load")) {
      result.load = location.at("load").text();
      result.name += " with load " + result.load;
    }
    return result;
  }

 private:
  [[nodiscard]] Index joint_of(const YamlField& field, const std::string& name) const {
    const auto found = std::ranges::find(model_->joints, name, &RobotJoint::name);
    if (found != model_->joints.end()) return found - model_->joints.begin();
    std::vector<std::string> names;
    for (const RobotJoint& joint : model_->joints) names.push_back(joint.name);
    field.fail(fmt::format("no joint '{}'; there are {}", name, fmt::join(names, ", ")));
  }

  // b with z = b^T q; names the location and sets its units.
  Eigen::VectorXd deflection(const YamlField& field, Location& location) const {
    if (field.has("joint") == field.has("deflection")) {
      field.fail("needs either joint and axis, or deflection");
    }
    Eigen::VectorXd b = Eigen::VectorXd::Zero(model_->size());
    if (field.has("joint")) {
      const Index joint = joint_of(field.at("joint"), field.at("joint").text());
      const std::string axis = field.at("axis").choice({"arm", "motor"});
      if (axis == "arm") {
        b(joint) = 1.0;
      } else {
        b = model_->transmission.row(joint);
      }
      location.name = fmt::format("{}.{}", field.at("joint").text(), axis);
    } else {
      for (const auto& [key, value] : field.at("deflection").entries()) {
        b(joint_of(value, key)) = value.number();
        location.name += (location.name.empty() ? "" : "-") + key;
      }
      if (b.isZero(0.0)) field.at("deflection").fail("must name at least one joint");
    }
    set_units(field, b, location);
    return b;
  }

  void set_units(const YamlField& field, const Eigen::VectorXd& b, Location& location) const {
    std::optional<bool> is_prismatic;
    for (Index i = 0; i < b.size(); ++i) {
      if (b(i) == 0.0) continue;
      const bool kind = model_->joints[static_cast<std::size_t>(i)].is_prismatic;
      if (is_prismatic.value_or(kind) != kind) {
        field.fail("mixes revolute and prismatic joints, which have no common unit");
      }
      is_prismatic = kind;
    }
    location.units = is_prismatic.value_or(false) ? PlaceUnits{"N", "m", "kg"}
                                                  : PlaceUnits{"N m", "rad", "kg m^2"};
  }

  const RigidRobotModel* model_;
};

void append_elements(std::vector<Element> added, const std::string& source,
                     RigidRobotModel& model) {
  for (Element& element : added) {
    if (element.law && element.law->state_count() > 1) {
      throw InputError(fmt::format(
          "{}: elements: '{}' has the law {}, a motion of its own that inverse dynamics "
          "does not follow; leave it out",
          source, element.name, element.law_name));
    }
    if (std::ranges::find(model.elements, element.name, &Element::name) != model.elements.end()) {
      throw InputError(fmt::format("{}: elements: '{}' is the name of an earlier element, too",
                                   source, element.name));
    }
    model.elements.push_back(std::move(element));
  }
}

// "element.parameter"; names of elements may hold dots.
ElementParameter parameter_named(const std::string& source, const std::string& text,
                                 const RigidRobotModel& model) {
  const std::size_t dot = text.rfind('.');
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format("{}: '{}' {}", source, text, why));
  };
  if (dot == std::string::npos) refuse("must be written as element.parameter");
  const auto element = std::ranges::find(model.elements, text.substr(0, dot), &Element::name);
  if (element == model.elements.end()) refuse("names no element of this model");
  const auto& parameters =
      find_law(element->law_name, element->location.kind != LocationKind::kElement)->parameters;
  const auto parameter = std::ranges::find(parameters, text.substr(dot + 1), &LawParameter::name);
  if (parameter == parameters.end()) {
    refuse(fmt::format("names no parameter of the law {}", element->law_name));
  }
  return {static_cast<std::size_t>(element - model.elements.begin()),
          static_cast<std::size_t>(parameter - parameters.begin())};
}

void add_refined(const std::string& source, const std::string& text, RigidRobotModel& model) {
  const ElementParameter place = parameter_named(source, text, model);
  const Element& element = model.elements[place.element];
  const LawEntry& law = *find_law(element.law_name, false);
  const bool remembers = element.law && element.law->state_count() > 0;
  const bool is_over_gains = element.use == LawUse::kPayload && model.channels.unknown_drive_gains;
  if (law.parameters[place.parameter].is_linear && !remembers && !is_over_gains) {
    throw InputError(fmt::format(
        "{}: '{}' enters the force linearly and is estimated without being refined", source, text));
  }
  model.refined.push_back(place);
}

// ---- channels -----------------------------------------------------------------------------------

std::vector<std::string> read_names(const YamlField& field, std::size_t size) {
  std::vector<std::string> names;
  for (const YamlField& item : field.items()) names.push_back(item.text());
  if (names.size() != size) {
    field.fail(fmt::format("must name {} channels, one a joint; names {}", size, names.size()));
  }
  return names;
}

RobotChannels read_channels(const YamlField& field, std::size_t size) {
  field.allow_keys({"torque", "torque_of", "drive_gains", "position", "position_of", "velocity",
                    "acceleration"});
  RobotChannels channels;
  channels.torque = read_names(field.at("torque"), size);
  if (field.has("position") || !field.has("velocity")) {
    channels.position = read_names(field.at("position"), size);
  }
  if (field.has("velocity")) channels.velocity = read_names(field.at("velocity"), size);
  if (field.has("acceleration")) {
    if (!field.has("velocity")) field.at("acceleration").fail("needs velocity, too");
    channels.acceleration = read_names(field.at("acceleration"), size);
  }
  channels.motor_torque = field.at("torque_of").choice({"motors", "arm"}) == "motors";
  channels.motor_position = field.at("position_of").choice({"motors", "arm"}) == "motors";
  channels.unknown_drive_gains =
      field.has("drive_gains") && field.at("drive_gains").choice({"known", "unknown"}) == "unknown";
  return channels;
}

// With unknown gains a force on two joints would be two parameters.
void check_drive_gains(const YamlField& field, const RigidRobotModel& model) {
  if (!model.channels.unknown_drive_gains) return;
  const YamlField gains = field.at("drive_gains");
  if (!model.transmission.isDiagonal(0.0)) {
    gains.fail(
        "unknown: needs motors that act on one joint each (gear_ratio in place of "
        "transmission)");
  }
  for (const Element& element : model.elements) {
    const bool is_single =
        element.use == LawUse::kPayload || (element.location.output.array() != 0.0).count() == 1;
    if (!is_single) {
      gains.fail(
          fmt::format("unknown: element '{}' acts on more than one joint, whose drives "
                      "report torques in different units; leave it out or state the gains",
                      element.name));
    }
  }
}

// Where the gains are unknown, all joints feel a payload, each over its own gain: a product of two
// unknowns, so that the mass is no linear parameter.
void refine_payloads_over_gains(RigidRobotModel& model) {
  if (!model.channels.unknown_drive_gains) return;
  for (std::size_t k = 0; k < model.elements.size(); ++k) {
    const auto is_mass = [k](const ElementParameter& place) {
      return place.element == k && place.parameter == 0;
    };
    if (model.elements[k].use == LawUse::kPayload && std::ranges::none_of(model.known, is_mass) &&
        std::ranges::none_of(model.refined, is_mass)) {
      model.refined.push_back({k, 0});
    }
  }
}

}  // namespace

std::unique_ptr<Places> rigid_robot_places(const RigidRobotModel& model) {
  return std::make_unique<RigidRobotPlaces>(model);
}

RigidRobotModel load_rigid_robot(const std::filesystem::path& file,
                                 const std::vector<std::filesystem::path>& physics,
                                 const std::vector<std::string>& refine) {
  const YamlField root = YamlField::load(file);
  (void)root.at("format").choice({"graybox-rigid-robot/1"});
  root.allow_keys({"format", "urdf", "base", "tip", "locked", "denavit_hartenberg", "gravity",
                   "joints", "transmission", "laws", "elements", "known", "refine", "channels",
                   "body_uncertainty",
                   "base_parameters"});  // the last: what a diagnosis estimated, to read
  RigidRobotModel model;
  model.name = file.stem().string();
  model.gravity = read_vector(root.at("gravity"));
  if (root.has("body_uncertainty")) {
    model.body_uncertainty = root.at("body_uncertainty").non_negative();
    if (model.body_uncertainty > 1.0) {
      root.at("body_uncertainty").fail("is a share of the stated values: 0 to 1, 0.1 for 10 %");
    }
  }
  const bool has_transmission = root.has("transmission");
  if (root.has("urdf") == root.has("denavit_hartenberg")) {
    root.fail("needs either urdf (with base and tip) or denavit_hartenberg: modified | standard");
  }
  if (root.has("locked") && !root.has("urdf")) {
    root.at("locked").fail("is for joints of a URDF: leave it out, or give urdf, base and tip");
  }
  if (root.has("urdf")) {
    read_urdf(root, file.parent_path(), has_transmission, model);
  } else {
    const bool is_modified =
        root.at("denavit_hartenberg").choice({"modified", "standard"}) == "modified";
    read_rows(root.at("joints"), is_modified, has_transmission, model);
  }
  check_names(root.at("joints"), model);
  const Eigen::VectorXd gear_ratios = model.transmission;
  model.transmission = has_transmission ? read_transmission(root.at("transmission"), model.size())
                                        : Eigen::MatrixXd(gear_ratios.asDiagonal());
  const RigidRobotPlaces places(model);
  append_elements(read_model_elements(root, places), file.string(), model);
  for (const std::filesystem::path& extra : physics) {
    append_elements(read_physics(extra, places), extra.string(), model);
  }
  if (root.has("channels")) {
    model.channels = read_channels(root.at("channels"), model.joints.size());
    check_drive_gains(root.at("channels"), model);
  }
  if (root.has("known")) {
    for (const YamlField& item : root.at("known").items()) {
      model.known.push_back(parameter_named(file.string() + ": known", item.text(), model));
    }
  }
  if (root.has("refine")) {
    for (const YamlField& item : root.at("refine").items()) {
      add_refined(file.string() + ": refine", item.text(), model);
    }
  }
  for (const std::string& text : refine) add_refined("--refine", text, model);
  refine_payloads_over_gains(model);
  return model;
}

}  // namespace graybox
