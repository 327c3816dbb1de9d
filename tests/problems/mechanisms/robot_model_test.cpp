#include "problems/mechanisms/robot_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <sstream>

#include "problems/base/error.hpp"
#include "tests/support/robot_test_support.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

using testing::replaced;

std::string read(const fs::path& file) {
  std::ifstream stream(file);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// The robot's two files in a folder of the test's own, each with one text replaced.
class RobotFiles : public ::testing::Test {
 protected:
  RobotFiles() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("graybox_robot_") + test->name());
    fs::create_directories(folder_);
    yaml_ = read(robot_test::robot_folder() / "irb6600_like.yaml");
    urdf_ = read(robot_test::robot_folder() / "irb6600_like.urdf");
  }
  ~RobotFiles() override { fs::remove_all(folder_); }

  RobotModel load(const std::string& yaml, const std::string& urdf) const {
    std::ofstream(folder_ / "robot.yaml") << yaml;
    std::ofstream(folder_ / "irb6600_like.urdf") << urdf;
    return load_robot_model(folder_ / "robot.yaml");
  }
  // The error's text, or "loaded".
  std::string error(const std::string& yaml, const std::string& urdf) const {
    try {
      (void)load(yaml, urdf);
    } catch (const InputError& error) {
      return error.what();
    }
    return "loaded";
  }
  std::string yaml_error(const std::string& from, const std::string& to) const {
    return error(replaced(yaml_, from, to), urdf_);
  }
  std::string urdf_error(const std::string& from, const std::string& to) const {
    return error(yaml_, replaced(urdf_, from, to));
  }

  fs::path folder_;
  std::string yaml_, urdf_;
};

void expect_line(const std::string& line, const std::string& part) {
  EXPECT_NE(line.find(part), std::string::npos) << line;
  EXPECT_EQ(line.find('\n'), std::string::npos) << line;
}

TEST(RobotModel, ThePapersRobotHasItsSpringsInOrder) {
  const RobotModel robot = robot_test::paper_robot();
  EXPECT_EQ(robot.arm_size(), 12);
  EXPECT_EQ(robot.motor_count(), 6);
  EXPECT_EQ(robot.name, "irb6600_like");
  std::vector<std::string> springs;
  for (const ArmSpring& spring : robot.springs) springs.push_back(spring.name);
  EXPECT_EQ(springs,
            (std::vector<std::string>{"joint_1.bearing_x", "joint_1.bearing_y", "joint_1.gearbox",
                                      "joint_2.bearing_x", "joint_2.bearing_z", "joint_2.gearbox",
                                      "joint_3.bearing_x", "joint_3.bearing_z", "joint_3.gearbox",
                                      "joint_4.gearbox", "joint_5.gearbox", "joint_6.gearbox"}));
  EXPECT_EQ(
      robot.parameter_names(),
      (std::vector<std::string>{"joint_1.gearbox", "joint_2.gearbox", "joint_3.gearbox",
                                "joint_4.gearbox", "joint_5.gearbox", "joint_6.gearbox",
                                "joint_1.bearing_x", "joint_1.bearing_y", "joint_2.bearing_x",
                                "joint_2.bearing_z", "joint_3.bearing_x", "joint_3.bearing_z"}));
  EXPECT_EQ(robot.gearbox_rotations(), (std::vector<Eigen::Index>{2, 5, 8, 9, 10, 11}));
  ASSERT_EQ(robot.frequencies.size(), 50U);
  EXPECT_NEAR(robot.frequencies.front(), 2.0 * std::numbers::pi, 1e-14);
  EXPECT_NEAR(robot.frequencies.back(), 120.0 * std::numbers::pi, 1e-11);
  EXPECT_NEAR(robot.frequencies[1] / robot.frequencies[0],
              robot.frequencies[49] / robot.frequencies[48], 1e-13);
}

// Joint origins and bearings stand where the figure of the chain says: stretched out at q = 0, the
// last frame is at (0.32 + 1.142 + 0.2, 0, 0.78 + 1.075 + 0.2).
TEST(RobotModel, TheChainReachesTheFlange) {
  const RobotModel robot = robot_test::paper_robot();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  double mass = 0.0;
  for (const ChainRotation& rotation : robot.chain.rotations()) {
    pose = pose * rotation.origin;
    mass += rotation.body.mass;
  }
  EXPECT_LT((pose.translation() - Eigen::Vector3d(1.662, 0.0, 2.055)).norm(), 1e-12);
  EXPECT_NEAR(mass, 1437.96, 1e-9);
}

TEST(RobotModel, TheDefaultFileIsThePapersRobot) {
  EXPECT_EQ(load_robot_model(default_robot_file()).name, "irb6600_like");
}

TEST(RobotModel, StiffnessFactorsScaleTheParametrisedSpringsAlone) {
  const RobotModel robot = robot_test::paper_robot();
  Eigen::VectorXd theta = Eigen::VectorXd::LinSpaced(12, 0.5, 1.6);
  const RobotModel scaled = with_stiffness_factors(robot, theta);
  for (std::size_t p = 0; p < robot.parameters.size(); ++p) {
    const ArmSpring& before = robot.springs[robot.parameters[p]];
    const ArmSpring& after = scaled.springs[robot.parameters[p]];
    EXPECT_DOUBLE_EQ(after.stiffness, before.stiffness * theta(static_cast<Eigen::Index>(p)));
    EXPECT_EQ(after.damping, before.damping);
  }
  EXPECT_THROW((void)with_stiffness_factors(robot, theta.head(11)), InputError);
  theta(3) = 0.0;
  EXPECT_THROW((void)with_stiffness_factors(robot, theta), InputError);
  theta(3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW((void)with_stiffness_factors(robot, theta), InputError);
}

TEST_F(RobotFiles, UnchangedFilesLoad) { EXPECT_EQ(error(yaml_, urdf_), "loaded"); }

TEST_F(RobotFiles, NegativeRatiosAreFine) {
  const RobotModel robot = load(replaced(yaml_, "gear_ratio: 220", "gear_ratio: -220"), urdf_);
  EXPECT_EQ(robot.transmission(0, 0), -220.0);
}

TEST_F(RobotFiles, FrequenciesMayBeListedOrLinear) {
  const std::string spec = "{from: 1, to: 60, count: 50, spacing: log}";
  EXPECT_EQ(load(replaced(yaml_, spec, "[1, 2.5, 7]"), urdf_).frequencies.size(), 3U);
  const RobotModel linear =
      load(replaced(yaml_, spec, "{from: 1, to: 5, count: 5, spacing: linear}"), urdf_);
  EXPECT_NEAR(linear.frequencies[1], 4.0 * std::numbers::pi, 1e-14);
}

TEST_F(RobotFiles, ParametersMayBeListed) {
  const RobotModel robot =
      load(replaced(yaml_, "all_stiffness", "[joint_2.bearing_z, joint_1.gearbox]"), urdf_);
  EXPECT_EQ(robot.parameters, (std::vector<std::size_t>{4, 2}));
}

TEST_F(RobotFiles, ATransmissionReplacesTheRatios) {
  std::string yaml = yaml_;
  for (const char* ratio : {"220", "244", "244", "147", "183", "116"}) {
    yaml = replaced(yaml, std::string("    gear_ratio: ") + ratio, "    #");
  }
  const std::string rows = "[220,0,0,0,0,0],[0,244,0,0,0,0],[0,0,244,0,0,0],[0,0,0,147,0,0],";
  const RobotModel robot =
      load(yaml + "transmission: [" + rows + "[0,0,0,-12,183,0],[0,0,0,3,-20,116]]\n", urdf_);
  EXPECT_EQ(robot.transmission(4, 3), -12.0);
  EXPECT_EQ(robot.transmission(5, 4), -20.0);

  expect_line(error(yaml, urdf_), "field 'gear_ratio' is missing");
  expect_line(error(yaml + "transmission: [" + rows + "[0,0,0,1,2,0]]\n", urdf_),
              "transmission: must have 6 rows");
  expect_line(error(yaml + "transmission: [" + rows + "[0,0,0,1,2,0],[0,0,0,2,4,0]]\n", urdf_),
              "transmission: must be invertible");
  expect_line(error(yaml_ + "transmission: [" + rows + "[0,0,0,1,2,0],[0,0,0,2,4,1]]\n", urdf_),
              "joints.joint_1.gear_ratio: the transmission matrix replaces the gear ratios");
}

TEST_F(RobotFiles, MistakesInTheModelFileAreNamed) {
  const std::string spring = "gearbox: {stiffness: 2.12e6, damping: 218}";
  const struct {
    const char *from, *to, *message;
  } cases[] = {
      {"graybox-robot/1", "graybox-robot/9", "format: must be one of graybox-robot/1"},
      {"urdf: irb6600_like.urdf", "urdf: none.urdf", "none.urdf: no such file"},
      {"base: base_link", "base: socket", "no link 'socket' (base)"},
      {"tip: flange", "tip: gripper", "no link 'gripper' (tip)"},
      {"tip: flange", "tip: base_link", "no moving joint between 'base_link' and 'base_link'"},
      {"base: base_link\ntip: flange", "base: flange\ntip: base_link", "is not beyond link"},
      {"gravity: [0, 0, -9.81]", "gravity: [0, -9.81]", "gravity: must hold 3 numbers, holds 2"},
      {"gravity: [0, 0, -9.81]", "gravity: down", "gravity: must be a list"},
      {"gravity: [0, 0, -9.81]", "gravity: [0, 0, .nan]", "gravity[2]: must be finite"},
      {"sample_time: 0.0005", "sample_time: fast", "sample_time: must be a number, is 'fast'"},
      {"sample_time: 0.0005", "sample_time: 0", "sample_time: must be positive, is 0"},
      {"sample_time: 0.0005", "sample_tim: 0.0005", "sample_tim: unknown field"},
      {"sample_time: 0.0005", "", "field 'sample_time' is missing"},
      {"sample_time: 0.0005", "sample_time: 0.01", "not below the Nyquist frequency"},
      {"  joint_3:", "  joint_7:", "joints.joint_7: no moving joint of this name"},
      {"  joint_2:", "  joint_1:", "given twice"},
      {"gear_ratio: 220", "gear_ratio: 0", "joints.joint_1.gear_ratio: must not be zero"},
      {"gear_ratio: 220", "gear_ratio: [220]", "joints.joint_1.gear_ratio: must be a number"},
      {"motor_inertia: 0.00515", "motor_inertia: 0", "joint_1.motor_inertia: must be positive"},
      {"motor_friction: 0.0", "motor_friction: -1", "motor_friction: must not be negative"},
      {"stiffness: 2.12e6", "stiffness: -2.12e6", "gearbox.stiffness: must be positive"},
      {"damping: 218", "damping: -218", "gearbox.damping: must not be negative"},
      {"damping: 218", "dampening: 218", "gearbox.dampening: unknown field"},
      {"gearbox: {stiffness: 2.12e6, damping: 218}", "", "field 'gearbox' is missing"},
      {"gearbox: {stiffness: 2.12e6, damping: 218}", "gearbox: 2.12e6", "must be a mapping"},
      {"axis: [1, 0, 0]", "axis: [0, 0, 0]", "bearings[0].axis: must not be zero"},
      {"axis: [1, 0, 0]", "axis: x", "bearings[0].axis: must be a list"},
      {"name: bearing_y", "name: bearing_x", "two bearings of this joint have this name"},
      {"name: bearing_y", "name: gearbox", "a bearing must not be called 'gearbox'"},
      {"kind: pi", "kind: pid", "controller.kind: must be one of pi; is 'pid'"},
      {"[1.92, 2.32,", "[1.92,", "controller.proportional: must hold 6 numbers, holds 5"},
      {"[1.92, 2.32,", "[1.92, -2.32,", "controller.proportional[1]: must be positive"},
      {"[0.11, 0.11,", "[0, 0.11,", "controller.integral_time[0]: must be positive"},
      {"velocity_psd_slope: 0.0827", "velocity_psd_slope: -1", "must be positive, is -1"},
      {"all_stiffness", "all_damping", "parameters: must be one of all_stiffness"},
      {"all_stiffness", "[joint_1.spring]", "parameters[0]: no spring 'joint_1.spring'"},
      {"all_stiffness", "[joint_1.gearbox, joint_1.gearbox]", "parameters[1]: given twice"},
      {"all_stiffness", "[]", "parameters: must name at least one spring"},
      {"count: 50", "count: 0", "frequencies.count: must be a whole number from 1 to"},
      {"count: 50", "count: 2.5", "frequencies.count: must be a whole number from 1 to"},
      {"to: 60", "to: 0.5", "frequencies.to: must be above 'from'"},
      {"spacing: log", "spacing: cubic", "frequencies.spacing: must be one of log, linear"},
      {"{from: 1, to: 60, count: 50, spacing: log}", "[2, 1]", "frequencies must increase"},
      {"{from: 1, to: 60, count: 50, spacing: log}", "[]", "at least one frequency"},
      {"reference_psd: 1.0", "reference_psd: 0", "reference_psd: must be positive"},
      {"base: base_link", "base: [", "not valid YAML"},
  };
  for (const auto& [from, to, message] : cases) expect_line(yaml_error(from, to), message);
  // With the line of the mistake, where it has one.
  expect_line(yaml_error("sample_time: 0.0005", "sample_time: -1"), "robot.yaml:15: sample_time:");
  expect_line(error("- a\n- b\n", urdf_), "must be a mapping of fields");
}

TEST_F(RobotFiles, MistakesInTheUrdfAreNamed) {
  const struct {
    const char *from, *to, *message;
  } cases[] = {
      {"<joint name=\"joint_2\" type=\"revolute\">", "<joint name=\"joint_2\" type=\"prismatic\">",
       "joint 'joint_2': only revolute, continuous and fixed joints"},
      {"<mass value=\"264.61\"/>", "<mass value=\"-264.61\"/>", "link 'link_2': mass"},
      {"ixx=\"33.585\"", "ixx=\"-33.585\"", "link 'link_2': inertia must be positive semidefinite"},
      {"<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>", "joint 'joint_2'"},
      {"<link name=\"link_5\">", "<link name=\"link_x\">", "not a valid URDF"},
      {"</robot>", "", "not a valid URDF"},
      {"<mass value=\"110.47\"/>", "<mass value=\"0\"/>", "loaded"},  // it still has inertia
  };
  for (const auto& [from, to, message] : cases) expect_line(urdf_error(from, to), message);

  std::string weightless = replaced(urdf_, "<mass value=\"110.47\"/>", "<mass value=\"0\"/>");
  weightless = replaced(weightless,
                        "ixx=\"4.475\" ixy=\"0\" ixz=\"0\" iyy=\"4.882\" iyz=\"0\" izz=\"4.882\"",
                        "ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"");
  expect_line(error(yaml_, weightless), "the mass matrix at q = 0 is singular");
}

// A payload on a fixed joint is part of the link it is fixed to.
TEST_F(RobotFiles, FixedLinksAreFoldedIn) {
  const std::string payload =
      "<link name=\"payload\"><inertial><origin xyz=\"0 0 0.5\"/><mass value=\"10\"/>"
      "<inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>"
      "<joint name=\"mount\" type=\"fixed\"><parent link=\"flange\"/><child link=\"payload\"/>"
      "<origin xyz=\"1 0 0\" rpy=\"0 1.5707963267948966 0\"/></joint></robot>";
  const std::string urdf = replaced(urdf_, "</robot>", payload);
  const RigidBody plain = load(yaml_, urdf_).chain.rotations().back().body;
  const RobotModel beside = load(yaml_, urdf);
  const RobotModel beyond = load(replaced(yaml_, "tip: flange", "tip: payload"), urdf);
  // A joint beside the chain is locked.
  const RobotModel locked =
      load(yaml_, replaced(urdf, "\"mount\" type=\"fixed\"", "\"mount\" type=\"continuous\""));
  for (const RobotModel* robot : {&beside, &beyond, &locked}) {
    const RigidBody body = robot->chain.rotations().back().body;
    EXPECT_NEAR(body.mass, plain.mass + 10.0, 1e-12);
    // Turned by 90 degrees about y, z of the payload points along x of the flange.
    const Eigen::Vector3d moment = plain.mass * plain.centre_of_mass + Eigen::Vector3d(15, 0, 0);
    EXPECT_LT((body.mass * body.centre_of_mass - moment).norm(), 1e-12);
  }
}

TEST(RobotModel, AMissingFileIsNamed) {
  try {
    (void)load_robot_model("/nowhere/robot.yaml");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "/nowhere/robot.yaml: no such file");
  }
}

}  // namespace
}  // namespace graybox
