#include "diagnosis/export/urdf_file.hpp"

#include <fmt/format.h>
#include <tinyxml.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <fstream>
#include <map>
#include <sstream>

#include "problems/base/error.hpp"
#include "problems/mechanisms/urdf_chain.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

struct JointFriction {
  double damping = 0.0, friction = 0.0;
};

// The one joint that an element acts on, and by how much its place moves with it.
struct JointPlace {
  Index joint = -1;
  double ratio = 0.0;
};

std::optional<JointPlace> joint_of(const Location& place) {
  if (place.input != place.output) return {};
  JointPlace result;
  for (Index i = 0; i < place.input.size(); ++i) {
    if (place.input(i) == 0.0) continue;
    if (result.joint >= 0) return {};
    result = {.joint = i, .ratio = place.input(i)};
  }
  return result;
}

class UrdfWriter {
 public:
  explicit UrdfWriter(const ExportedModel& model) : model_(model) {
    require_urdf();
    load();
    for (const Element& element : model.forces) take_force(element);
    for (const Element& element : model.inertias) take_inertia(element);
    if (!obstacles_.empty()) refuse_export(model, obstacles_);
  }

  UrdfExport run() {
    write_friction();
    write_inertias();
    write_payloads();
    note_rotors();
    TiXmlPrinter printer;
    printer.SetIndent("  ");
    document_.Accept(&printer);
    return {.text = printer.Str(), .notes = std::move(notes_)};
  }

 private:
  void require_urdf() const {
    if (!model_.robot || model_.urdf.empty()) {
      throw InputError(
          fmt::format("{}: has no URDF that could take what was found: --to c or --to csv, or a "
                      "graybox-rigid-robot/1 model with urdf, base and tip",
                      model_.file.string()));
    }
    if (model_.has_base_parameters) {
      throw InputError(fmt::format(
          "{}: its bodies are known by base parameters alone, which no body in a URDF has: --to c, "
          "or a model with the bodies of the URDF",
          model_.file.string()));
    }
  }

  void load() {
    std::ifstream stream(model_.urdf);
    std::ostringstream text;
    text << stream.rdbuf();
    TiXmlBase::SetCondenseWhiteSpace(false);
    document_.Parse(text.str().c_str());
    if (document_.Error() || document_.FirstChildElement("robot") == nullptr) {
      throw InputError(
          fmt::format("{}: can't be read as XML: {}", model_.urdf.string(), document_.ErrorDesc()));
    }
    for (const UrdfJoint& joint : read_urdf_tree(model_.urdf)) links_[joint.name] = joint.child;
  }

  [[nodiscard]] TiXmlElement* named(const char* kind, const std::string& name) {
    TiXmlElement* each = document_.FirstChildElement("robot")->FirstChildElement(kind);
    while (each != nullptr && name != (each->Attribute("name") ? each->Attribute("name") : "")) {
      each = each->NextSiblingElement(kind);
    }
    if (each == nullptr) {
      throw InputError(fmt::format("{}: no {} '{}'", model_.urdf.string(), kind, name));
    }
    return each;
  }

  static TiXmlElement* child(TiXmlElement* parent, const char* kind) {
    if (TiXmlElement* found = parent->FirstChildElement(kind)) return found;
    return parent->InsertEndChild(TiXmlElement(kind))->ToElement();
  }

  static void set(TiXmlElement* element, const char* attribute, double value) {
    element->SetAttribute(attribute, fmt::format("{}", value).c_str());
  }

  [[nodiscard]] const RobotJoint& joint(Index j) const {
    return model_.robot->joints[static_cast<std::size_t>(j)];
  }

  // ---- what there is a place for ----

  void take_force(const Element& element) {
    const std::optional<JointPlace> place = joint_of(element.location);
    const bool is_viscous = element.law_name == "viscous";
    if (!place || (!is_viscous && element.law_name != "coulomb")) {
      obstacles_.push_back(fmt::format(
          "a URDF has damping and friction of single joints, and no place for element {} (--to c "
          "and --to csv have; or put viscous and coulomb in its place)",
          element_words(element)));
      return;
    }
    JointFriction& friction = friction_[place->joint];
    if (is_viscous) {
      friction.damping += element.parameters[0] * place->ratio * place->ratio;
    } else {
      friction.friction += element.parameters[0] * std::abs(place->ratio);
    }
  }

  // In the tensor of the first link it is what it is at the joint; further out it would also turn
  // with the joints before.
  void take_inertia(const Element& element) {
    const std::optional<JointPlace> place = joint_of(element.location);
    const bool is_first = place && place->joint == 0;
    const bool hangs = is_first && joint(0).is_prismatic &&
                       model_.robot->gravity.dot(joint(0).origin.linear() * joint(0).axis) != 0.0;
    if (!is_first || hangs) {
      obstacles_.push_back(fmt::format(
          "a URDF has no inertia of a joint, and in a link element {} would {} (--to c has it; "
          "MuJoCo calls it armature)",
          element_words(element), hangs ? "have weight" : "turn with the joints before, too"));
      return;
    }
    added_inertia_ += element.parameters[0] * place->ratio * place->ratio;
  }

  // ---- writing ----

  void write_friction() {
    for (Index j = 0; j < model_.size(); ++j) {
      const std::string& name = joint(j).name;
      TiXmlElement* element = named("joint", name);
      const TiXmlElement* before = element->FirstChildElement("dynamics");
      const auto found = friction_.find(j);
      if (before != nullptr) {
        const auto text = [&](const char* key) {
          return before->Attribute(key) ? before->Attribute(key) : "0";
        };
        notes_.push_back(fmt::format(
            "joint {} had damping {} and friction {}, which the model does not have: {}", name,
            text("damping"), text("friction"),
            found == friction_.end() ? "they stay" : "they are replaced"));
      }
      if (found == friction_.end()) continue;
      TiXmlElement* dynamics = child(element, "dynamics");
      set(dynamics, "damping", found->second.damping);
      set(dynamics, "friction", found->second.friction);
    }
  }

  void write_body(const std::string& link, const RigidBody& body) {
    const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(body.inertia, Eigen::EigenvaluesOnly);
    if (solver.eigenvalues()(0) < -1e-12 * solver.eigenvalues().cwiseAbs().maxCoeff() ||
        !(body.mass > 0.0)) {
      throw InputError(
          fmt::format("{}: with what was found link '{}' has a mass or a moment of inertia below "
                      "zero, which no "
                      "URDF may have: --to c, or --without the inertia",
                      model_.file.string(), link));
    }
    TiXmlElement* inertial = child(named("link", link), "inertial");
    TiXmlElement* origin = child(inertial, "origin");
    const Vector3d& c = body.centre_of_mass;
    origin->SetAttribute("xyz", fmt::format("{} {} {}", c.x(), c.y(), c.z()).c_str());
    origin->SetAttribute("rpy", "0 0 0");
    set(child(inertial, "mass"), "value", body.mass);
    TiXmlElement* inertia = child(inertial, "inertia");
    constexpr const char* kNames[3][3] = {
        {"ixx", "ixy", "ixz"}, {"", "iyy", "iyz"}, {"", "", "izz"}};
    for (Index i = 0; i < 3; ++i) {
      for (Index k = i; k < 3; ++k) set(inertia, kNames[i][k], body.inertia(i, k));
    }
  }

  void write_inertias() {
    if (added_inertia_ == 0.0) return;
    const std::string& link = links_.at(joint(0).name);
    RigidBody body = read_urdf_body(model_.urdf, link);
    if (joint(0).is_prismatic) {
      body.mass += added_inertia_;
    } else {
      body.inertia += added_inertia_ * joint(0).axis * joint(0).axis.transpose();
    }
    write_body(link, body);
    changed_[link] = body;
  }

  void write_payloads() {
    if (model_.payloads.empty()) return;
    const std::string& link = links_.at(model_.robot->joints.back().name);
    const auto changed = changed_.find(link);
    RigidBody body =
        changed != changed_.end() ? changed->second : read_urdf_body(model_.urdf, link);
    for (const Element& payload : model_.payloads) {
      const std::vector<double>& p = payload.parameters;
      body =
          joined(body, {p[0], model_.robot->flange * Vector3d(p[1], p[2], p[3]), Matrix3d::Zero()});
    }
    write_body(link, body);
  }

  void note_rotors() {
    for (const ExportedNumber& number : model_.numbers) {
      if (number.name != "rotor_inertia" || number.value == 0.0) continue;
      notes_.push_back(
          fmt::format("a URDF has no rotor inertia: that of {} is {} {} on the motor's side",
                      number.owner, number.value, number.unit));
    }
  }

  const ExportedModel& model_;
  TiXmlDocument document_;
  std::map<std::string, std::string> links_;  // the child link of each joint
  std::map<Index, JointFriction> friction_;
  double added_inertia_ = 0.0;
  std::map<std::string, RigidBody> changed_;
  std::vector<std::string> obstacles_, notes_;
};

}  // namespace

UrdfExport urdf_with_findings(const ExportedModel& model) { return UrdfWriter(model).run(); }

}  // namespace graybox
