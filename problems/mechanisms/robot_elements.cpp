#include "problems/mechanisms/robot_elements.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <algorithm>

#include "problems/base/error.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

Eigen::Index joint_of(const YamlField& field, const RobotModel& robot) {
  const std::string name = field.text();
  const auto found = std::ranges::find(robot.joint_names, name);
  if (found == robot.joint_names.end()) {
    field.fail(
        fmt::format("no joint '{}'; there are {}", name, fmt::join(robot.joint_names, ", ")));
  }
  return found - robot.joint_names.begin();
}

// The rotations of one joint, by the names of their springs.
std::vector<std::string> axes_of(const RobotModel& robot, Eigen::Index joint) {
  std::vector<std::string> axes{"motor", "arm"};
  for (const ArmSpring& spring : robot.springs) {
    if (spring.joint == static_cast<std::size_t>(joint)) {
      axes.push_back(spring.name.substr(spring.name.find('.') + 1));
    }
  }
  return axes;
}

RigidChain with_body(const RigidChain& chain, std::size_t index, const RigidBody& body) {
  std::vector<ChainRotation> rotations = chain.rotations();
  rotations[index].body = body;
  return {std::move(rotations), chain.gravity()};
}

// A body and a point mass m at p: the mass centre moves, and about the new one the inertia of two
// masses at distance d is mu (d^2 I - d d^T), mu = m_1 m_2 / (m_1 + m_2).
RigidBody with_point_mass(const RigidBody& body, double mass, const Eigen::Vector3d& place) {
  RigidBody joined;
  joined.mass = body.mass + mass;
  joined.centre_of_mass = (body.mass * body.centre_of_mass + mass * place) / joined.mass;
  const Eigen::Vector3d apart = place - body.centre_of_mass;
  joined.inertia = body.inertia + body.mass * mass / joined.mass *
                                      (apart.squaredNorm() * Eigen::Matrix3d::Identity() -
                                       apart * apart.transpose());
  return joined;
}

}  // namespace

void build_in_inertia(RobotModel& robot, const Element& element) {
  const auto& p = element.parameters;
  const auto& rotations = robot.chain.rotations();
  if (element.use == LawUse::kPayload) {
    const std::size_t last = rotations.size() - 1;
    robot.chain = with_body(robot.chain, last,
                            with_point_mass(rotations[last].body, p[0], {p[1], p[2], p[3]}));
    return;
  }
  const Eigen::Index channel = element.location.channel;  // the joint
  const bool is_motor = !element.location.output.tail(robot.motor_count()).isZero(0.0);
  if (is_motor) {
    robot.motor_inertia(channel) += p[0];
    return;
  }
  const auto rotation =
      static_cast<std::size_t>(robot.gearbox_rotations()[static_cast<std::size_t>(channel)]);
  RigidBody body = rotations[rotation].body;
  const Eigen::Vector3d axis = rotations[rotation].axis;
  body.inertia += p[0] * axis * axis.transpose();
  robot.chain = with_body(robot.chain, rotation, body);
}

namespace {

void check_inertia(const RobotModel& robot, const std::filesystem::path& file) {
  RigidChainEvaluator evaluator(robot.chain);
  const Eigen::MatrixXd& mass = evaluator.mass_matrix(Eigen::VectorXd::Zero(robot.arm_size()));
  if (robot.motor_inertia.minCoeff() <= 0.0 ||
      Eigen::LLT<Eigen::MatrixXd>(mass).info() != Eigen::Success) {
    throw InputError(fmt::format("{}: elements: negative inertia leaves a motor or the arm none",
                                 file.string()));
  }
}

}  // namespace

// b of a place at a joint, so that z = b^T q; fills the units and the name.
Eigen::VectorXd RobotPlaces::coordinate(const YamlField& location, Location& result) const {
  const RobotModel& robot = *robot_;
  const Eigen::Index joint = joint_of(location.at("joint"), robot);
  const std::string axis = location.at("axis").text();
  const auto axes = axes_of(robot, joint);
  if (std::ranges::find(axes, axis) == axes.end()) {
    location.at("axis").fail(fmt::format("no axis '{}' at {}; there are {}", axis,
                                         robot.joint_names[static_cast<std::size_t>(joint)],
                                         fmt::join(axes, ", ")));
  }
  const Eigen::Index arm = robot.arm_size(), size = arm + robot.motor_count();
  const Eigen::Index gearbox = robot.gearbox_rotations()[static_cast<std::size_t>(joint)];
  const std::string& joint_name = robot.joint_names[static_cast<std::size_t>(joint)];
  result.name = fmt::format("{}.{}", joint_name, axis);
  result.channel = joint;
  result.takes_inertia = axis == "motor" || axis == "arm";
  result.units = {"N m", "rad", "kg m^2"};
  Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
  if (axis == "motor") {
    b.tail(robot.motor_count()) = robot.transmission.row(joint).transpose();
  } else if (axis == "arm") {
    b(gearbox) = 1.0;
  } else if (axis == "gearbox") {
    b(gearbox) = 1.0;
    b(arm + joint) = -1.0;
  } else {
    const auto spring = std::ranges::find(robot.springs, result.name, &ArmSpring::name);
    b(spring - robot.springs.begin()) = 1.0;
  }
  return b;
}

Location RobotPlaces::resolve(const YamlField& location) const {
  Location result;
  const std::string kind = location.at("kind").choice({"element", "actuator", "sensor"});
  if (kind == "element") {
    if (location.has("axis") && location.at("axis").text() == "flange") {
      location.allow_keys({"kind", "axis"});
      return flange_location();
    }
    location.allow_keys({"kind", "joint", "axis", "driven_by"});
    result.output = result.input = coordinate(location, result);
    if (location.has("driven_by")) {
      const YamlField driver = location.at("driven_by");
      driver.allow_keys({"joint", "axis"});
      Location driving;
      result.input = coordinate(driver, driving);
      result.name += " driven by " + driving.name;
      result.takes_inertia = false;
    }
    return result;
  }
  location.allow_keys({"kind", "joint"});
  const bool is_actuator = kind == "actuator";
  result.kind = is_actuator ? LocationKind::kActuator : LocationKind::kSensor;
  result.channel = joint_of(location.at("joint"), *robot_);
  result.name =
      fmt::format("{} {}", kind, robot_->joint_names[static_cast<std::size_t>(result.channel)]);
  result.units.force = is_actuator ? "N m" : "rad/s";
  return result;
}

ExtendedRobot load_extended_robot(const std::filesystem::path& file,
                                  const std::optional<std::filesystem::path>& physics) {
  ExtendedRobot extended{load_robot_without_elements(file), {}};
  const RobotPlaces places(extended.robot);
  const YamlField root = YamlField::load(file);
  extended.elements = read_model_elements(root, places);
  if (physics) {
    for (Element& element : read_physics(*physics, places)) {
      extended.elements.push_back(std::move(element));
    }
  }
  for (const Element& element : extended.elements) {
    if (element.use == LawUse::kInertia || element.use == LawUse::kPayload) {
      build_in_inertia(extended.robot, element);
    }
  }
  check_inertia(extended.robot, physics.value_or(file));
  return extended;
}

namespace {

// The robot's own spring or damper at the element's place that has the element's law; null where it
// has none.
double* own_part(RobotModel& robot, const Element& element) {
  const Location& place = element.location;
  if (place.kind != LocationKind::kElement || place.output != place.input) return nullptr;
  const auto spring = std::ranges::find(robot.springs, place.name, &ArmSpring::name);
  const bool is_at_spring = spring != robot.springs.end();
  if (element.law_name == "stiffness") return is_at_spring ? &spring->stiffness : nullptr;
  if (element.law_name != "viscous") return nullptr;
  if (is_at_spring) return &spring->damping;
  const bool is_motor = place.output.head(robot.arm_size()).isZero(0.0);
  return is_motor ? &robot.motor_friction(place.channel) : nullptr;
}

}  // namespace

LinearRobot load_linear_robot(const std::filesystem::path& file) {
  ExtendedRobot extended = load_extended_robot(file);
  LinearRobot result{std::move(extended.robot), {}};
  for (const Element& element : extended.elements) {
    if (element.use == LawUse::kInertia || element.use == LawUse::kPayload) continue;  // built in
    const std::string name =
        fmt::format("'{}' ({} at {})", element.name, element.law_name, element.location.name);
    double* const part = own_part(result.robot, element);
    if (part == nullptr) {
      result.left_out.push_back(name);
      continue;
    }
    *part += element.parameters.front();
    const bool may_be_zero = element.law_name == "viscous";
    if (*part > 0.0 || (may_be_zero && *part == 0.0)) continue;
    throw InputError(
        fmt::format("{}: elements: {}: in sum with the robot's own it is {:g}, but must {}",
                    file.string(), name, *part, may_be_zero ? "not be negative" : "be positive"));
  }
  return result;
}

}  // namespace graybox
