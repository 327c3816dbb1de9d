#include "problems/mechanisms/robot_model.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/environment_text.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/mechanisms/urdf_chain.hpp"

namespace graybox {
namespace {

struct JointFile {  // what the YAML says of one joint
  double motor_inertia = 0.0;
  double motor_friction = 0.0;
  double gear_ratio = 0.0;
  std::vector<ChainRotation> bearings;
  std::vector<ArmSpring> springs;  // of the bearings, then of the gearbox
};

Eigen::Vector3d read_vector3(const YamlField& field) {
  const std::vector<double> v = field.numbers(3);
  return {v[0], v[1], v[2]};
}

ArmSpring read_spring(const YamlField& field, const std::string& name, std::size_t joint,
                      bool is_gearbox) {
  return {name, field.at("stiffness").positive(), field.at("damping").non_negative(), joint,
          is_gearbox};
}

void read_bearing(const YamlField& field, const std::string& joint_name, std::size_t joint,
                  JointFile& result) {
  field.allow_keys({"name", "axis", "stiffness", "damping"});
  const std::string name = joint_name + "." + field.at("name").text();
  for (const ArmSpring& other : result.springs) {
    if (other.name == name) field.at("name").fail("two bearings of this joint have this name");
  }
  ChainRotation rotation;
  rotation.name = name;
  rotation.axis = read_vector3(field.at("axis"));
  if (rotation.axis.norm() == 0.0) field.at("axis").fail("must not be zero");
  result.bearings.push_back(rotation);
  result.springs.push_back(read_spring(field, name, joint, false));
}

JointFile read_joint(const YamlField& field, const std::string& name, std::size_t joint,
                     bool has_transmission) {
  field.allow_keys({"gear_ratio", "motor_inertia", "motor_friction", "gearbox", "bearings"});
  JointFile result;
  result.motor_inertia = field.at("motor_inertia").positive();
  if (field.has("motor_friction")) {
    result.motor_friction = field.at("motor_friction").non_negative();
  }
  if (has_transmission) {
    if (field.has("gear_ratio")) {
      field.at("gear_ratio").fail("the transmission matrix replaces the gear ratios: give one");
    }
  } else {
    result.gear_ratio = field.at("gear_ratio").number();
    if (result.gear_ratio == 0.0) field.at("gear_ratio").fail("must not be zero");
  }
  if (field.has("bearings")) {
    for (const YamlField& bearing : field.at("bearings").items()) {
      read_bearing(bearing, name, joint, result);
    }
  }
  const YamlField gearbox = field.at("gearbox");
  gearbox.allow_keys({"stiffness", "damping"});
  const std::string gearbox_name = name + ".gearbox";
  for (const ArmSpring& bearing : result.springs) {
    if (bearing.name == gearbox_name) field.fail("a bearing must not be called 'gearbox'");
  }
  result.springs.push_back(read_spring(gearbox, gearbox_name, joint, true));
  return result;
}

// Puts the bearings of each joint between the joint's fixed offset and its gearbox rotation.
std::vector<ChainRotation> insert_bearings(const std::vector<ChainRotation>& urdf,
                                           const std::vector<JointFile>& joints) {
  std::vector<ChainRotation> result;
  for (std::size_t j = 0; j < urdf.size(); ++j) {
    Eigen::Isometry3d origin = urdf[j].origin;
    for (ChainRotation bearing : joints[j].bearings) {
      bearing.origin = std::exchange(origin, Eigen::Isometry3d::Identity());
      result.push_back(bearing);
    }
    ChainRotation gearbox = urdf[j];
    gearbox.name += ".gearbox";
    gearbox.origin = origin;
    result.push_back(gearbox);
  }
  return result;
}

Eigen::MatrixXd read_transmission(const YamlField& field, std::size_t size) {
  const std::vector<YamlField> rows = field.items();
  if (rows.size() != size) {
    field.fail(fmt::format("must have {} rows, one a motor; has {}", size, rows.size()));
  }
  const auto n = static_cast<Eigen::Index>(size);
  Eigen::MatrixXd matrix(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::vector<double> row = rows[static_cast<std::size_t>(i)].numbers(size);
    matrix.row(i) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), n);
  }
  if (!Eigen::FullPivLU<Eigen::MatrixXd>(matrix).isInvertible()) {
    field.fail("must be invertible: every joint needs a motor of its own");
  }
  return matrix;
}

std::vector<double> spaced_frequencies(const YamlField& field) {
  field.allow_keys({"from", "to", "count", "spacing"});
  const double from = field.at("from").positive();
  const double to = field.at("to").positive();
  const std::size_t count = field.at("count").count();
  const bool log = field.at("spacing").choice({"log", "linear"}) == "log";
  if (to < from || (count > 1 && to == from)) field.at("to").fail("must be above 'from'");
  std::vector<double> result(count, from);
  for (std::size_t k = 1; k < count; ++k) {
    const double part = static_cast<double>(k) / static_cast<double>(count - 1);
    result[k] = log ? from * std::pow(to / from, part) : from + (to - from) * part;
  }
  return result;
}

// In rad/s, below the Nyquist frequency.
std::vector<double> read_frequencies(const YamlField& field, double sample_time) {
  std::vector<double> result;
  if (field.is_list()) {
    for (const YamlField& item : field.items()) {
      result.push_back(item.positive());
      if (result.size() > 1 && result[result.size() - 2] >= result.back()) {
        item.fail("frequencies must increase");
      }
    }
    if (result.empty()) field.fail("must hold at least one frequency");
  } else {
    result = spaced_frequencies(field);
  }
  if (result.back() >= 0.5 / sample_time) {
    field.fail(fmt::format("{} Hz is not below the Nyquist frequency of the sample time, {} Hz",
                           result.back(), 0.5 / sample_time));
  }
  for (double& f : result) f *= 2.0 * std::numbers::pi;
  return result;
}

// "all_stiffness" is the gearboxes in chain order, then the bearings in chain order.
std::vector<std::size_t> read_parameters(const YamlField& field,
                                         const std::vector<ArmSpring>& springs) {
  std::vector<std::size_t> result;
  if (!field.is_list()) {
    (void)field.choice({"all_stiffness"});
    for (const bool gearbox : {true, false}) {
      for (std::size_t s = 0; s < springs.size(); ++s) {
        if (springs[s].is_gearbox == gearbox) result.push_back(s);
      }
    }
    return result;
  }
  for (const YamlField& item : field.items()) {
    const std::string name = item.text();
    const auto found = std::ranges::find(springs, name, &ArmSpring::name);
    if (found == springs.end()) {
      item.fail(fmt::format("no spring '{}'; springs are called like '{}'", name, springs[0].name));
    }
    const auto index = static_cast<std::size_t>(found - springs.begin());
    if (std::ranges::find(result, index) != result.end()) item.fail("given twice");
    result.push_back(index);
  }
  if (result.empty()) field.fail("must name at least one spring");
  return result;
}

std::vector<JointFile> read_joints(const YamlField& field, const std::vector<ChainRotation>& urdf,
                                   const std::string& urdf_name, bool has_transmission) {
  std::map<std::string, YamlField> entries;
  for (const auto& [name, entry] : field.entries()) {
    if (std::ranges::find(urdf, name, &ChainRotation::name) == urdf.end()) {
      entry.fail(fmt::format("no moving joint of this name between base and tip in {}", urdf_name));
    }
    if (!entries.emplace(name, entry).second) entry.fail("given twice");
  }
  std::vector<JointFile> result;
  for (std::size_t j = 0; j < urdf.size(); ++j) {
    const auto entry = entries.find(urdf[j].name);
    if (entry == entries.end()) {
      field.fail(fmt::format("joint '{}' of {} is missing", urdf[j].name, urdf_name));
    }
    result.push_back(read_joint(entry->second, urdf[j].name, j, has_transmission));
  }
  return result;
}

// Without it the equations of motion cannot be solved for the accelerations.
void check_mass_matrix(const RobotModel& model, const YamlField& urdf) {
  RigidChainEvaluator evaluator(model.chain);
  const Eigen::MatrixXd& mass = evaluator.mass_matrix(Eigen::VectorXd::Zero(model.arm_size()));
  if (Eigen::LLT<Eigen::MatrixXd>(mass).info() != Eigen::Success) {
    urdf.fail("the mass matrix at q = 0 is singular: give the outer links mass and inertia");
  }
}

}  // namespace

PiController read_pi_controller(const YamlField& field, std::size_t size) {
  field.allow_keys({"kind", "proportional", "integral_time"});
  (void)field.at("kind").choice({"pi"});
  PiController result;
  const auto read = [&](const char* key) {
    const std::vector<double> values = field.at(key).numbers(size);
    for (const YamlField& item : field.at(key).items()) (void)item.positive();
    return Eigen::VectorXd(
        Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(size)));
  };
  result.proportional = read("proportional");
  result.integral_time = read("integral_time");
  return result;
}

std::vector<std::string> RobotModel::parameter_names() const {
  std::vector<std::string> names;
  for (const std::size_t spring : parameters) names.push_back(springs[spring].name);
  return names;
}

std::vector<Eigen::Index> RobotModel::gearbox_rotations() const {
  std::vector<Eigen::Index> rotations;
  for (std::size_t s = 0; s < springs.size(); ++s) {
    if (springs[s].is_gearbox) rotations.push_back(static_cast<Eigen::Index>(s));
  }
  return rotations;
}

RobotModel load_robot_model(const std::filesystem::path& file) {
  const YamlField root = YamlField::load(file);
  if (root.has("elements")) {
    root.at("elements").fail("are not read here; leave them out");
  }
  return load_robot_without_elements(file);
}

RobotModel load_robot_without_elements(const std::filesystem::path& file) {
  const YamlField root = YamlField::load(file);
  (void)root.at("format").choice({"graybox-robot/1"});
  root.allow_keys({"format", "urdf", "base", "tip", "gravity", "sample_time", "joints",
                   "transmission", "controller", "noise", "parameters", "excitation", "laws",
                   "elements"});

  const std::string urdf_name = with_environment(root.at("urdf"));
  const std::vector<ChainRotation> urdf = read_urdf_chain(
      file.parent_path() / urdf_name, root.at("base").text(), root.at("tip").text());
  const std::size_t count = urdf.size();
  const bool has_transmission = root.has("transmission");
  const std::vector<JointFile> joints =
      read_joints(root.at("joints"), urdf, urdf_name, has_transmission);

  const auto n = static_cast<Eigen::Index>(count);
  RobotModel model{
      .name = file.stem().string(),
      .chain = RigidChain(insert_bearings(urdf, joints), read_vector3(root.at("gravity"))),
      .springs = {},
      .joint_names = {},
      .transmission = Eigen::MatrixXd::Zero(n, n),
      .motor_inertia = Eigen::VectorXd(n),
      .motor_friction = Eigen::VectorXd(n),
      .sample_time = root.at("sample_time").positive(),
      .controller = read_pi_controller(root.at("controller"), count),
      .frequencies = {},
      .parameters = {}};
  for (std::size_t j = 0; j < count; ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    model.joint_names.push_back(urdf[j].name);
    model.springs.insert(model.springs.end(), joints[j].springs.begin(), joints[j].springs.end());
    model.transmission(i, i) = joints[j].gear_ratio;
    model.motor_inertia(i) = joints[j].motor_inertia;
    model.motor_friction(i) = joints[j].motor_friction;
  }
  if (has_transmission) model.transmission = read_transmission(root.at("transmission"), count);

  const YamlField noise = root.at("noise");
  noise.allow_keys({"velocity_psd_slope"});
  model.velocity_psd_slope = noise.at("velocity_psd_slope").positive();
  const YamlField excitation = root.at("excitation");
  excitation.allow_keys({"frequencies", "reference_psd"});
  model.reference_psd = excitation.at("reference_psd").positive();
  model.frequencies = read_frequencies(excitation.at("frequencies"), model.sample_time);
  model.parameters = read_parameters(root.at("parameters"), model.springs);
  check_mass_matrix(model, root.at("urdf"));
  return model;
}

RobotModel with_stiffness_factors(const RobotModel& robot, const Eigen::VectorXd& theta) {
  if (theta.size() != static_cast<Eigen::Index>(robot.parameters.size())) {
    throw InputError(fmt::format("{}: {} stiffness factors given for {} parameters", robot.name,
                                 theta.size(), robot.parameters.size()));
  }
  RobotModel scaled = robot;
  for (std::size_t p = 0; p < robot.parameters.size(); ++p) {
    const double factor = theta(static_cast<Eigen::Index>(p));
    if (!(factor > 0.0) || !std::isfinite(factor)) {
      throw InputError(fmt::format("{}: stiffness factor {} of {} must be positive", robot.name,
                                   factor, robot.parameter_names()[p]));
    }
    scaled.springs[robot.parameters[p]].stiffness *= factor;
  }
  return scaled;
}

std::filesystem::path default_robot_file() {
  namespace fs = std::filesystem;
  const fs::path name = "irb6600_like.yaml";
  std::vector<fs::path> folders;
  if (const char* folder = std::getenv("GRAYBOX_ROBOT_DIR")) folders.emplace_back(folder);
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  if (!program.empty()) {
    folders.push_back(program.parent_path().parent_path() / "share/graybox/robot");
  }
  folders.emplace_back(GRAYBOX_ROBOT_SOURCE_DIR);
  for (const fs::path& folder : folders) {
    if (fs::is_regular_file(folder / name, ignored)) return folder / name;
  }
  throw InputError(fmt::format("{} not found: set GRAYBOX_ROBOT_DIR to the folder that holds it",
                               name.string()));
}

}  // namespace graybox
