// `graybox export` as users run it: after a diagnosis, into files and to the screen.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"
#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::read_text;
using Json = nlohmann::json;

const std::string kExamples = std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/";

using ExportCommand = testing::CommandRunner;

// From recordings to a feed-forward that compiles and gives the force of the model found.
TEST_F(ExportCommand, TurnsADiagnosisIntoACFunction) {
  const std::string drive = kExamples + "fit/drive";
  ASSERT_EQ(graybox("diagnose " + drive + "/motor.yaml " + drive + " -o report").exit_code, 0);
  const testing::Outcome written =
      graybox("export report/model_extended.yaml --to c --name motor -o motor.c");
  ASSERT_EQ(written.exit_code, 0) << written.err;
  EXPECT_EQ(written.out, "wrote motor.c\n");
  const std::string source = read_text(folder_.file("motor.c"));
  EXPECT_EQ(graybox("export report/model_extended.yaml --to c --name motor").out, source);
  testing::write_text(folder_.file("main.c"),
                      "#include <stdio.h>\n"
                      "void motor_force(const double*, const double*, const double*, double*);\n"
                      "int main(void) {\n"
                      "  const double q = 0.3, v = -1.7, a = 40.0;\n  double f;\n"
                      "  motor_force(&q, &v, &a, &f);\n  printf(\"%.17g\", f);\n  return 0;\n}\n");
  ASSERT_EQ(std::system(fmt::format("cd '{}' && cc -std=c99 -Wall -Wextra -Werror main.c motor.c "
                                    "-lm -o program && ./program > out",
                                    folder_.file(""))
                            .c_str()),
            0);
  const LumpedModel model = load_lumped_model(folder_.file("report/model_extended.yaml"));
  ASSERT_EQ(model.elements.size(), 1U);  // the friction that was found
  const double force = model.mass(0, 0) * 40.0 - 1.7 * model.damping(0, 0) +
                       model.elements[0].law->force(0.3, -1.7, {});
  EXPECT_NEAR(std::stod(read_text(folder_.file("out"))), force, 1e-9 * std::abs(force));

  const testing::Outcome tables = graybox("export report/model_extended.yaml --to csv -o tables");
  EXPECT_EQ(tables.exit_code, 0) << tables.err;
  EXPECT_EQ(tables.out, "wrote tables/parameters.csv\nwrote tables/friction_motor.csv\n");
  EXPECT_EQ(graybox("export report/model_extended.yaml --to csv").out,
            read_text(folder_.file("tables/parameters.csv")));
}

// The force of a model of one coordinate at this state, from the function NAME_force of its C.
double force_of(const std::string& folder, const std::string& name, double v, double a) {
  testing::write_text(
      folder + "main.c",
      fmt::format("#include <stdio.h>\n"
                  "void {0}_force(const double*, const double*, const double*, double*);\n"
                  "int main(void) {{\n  const double q = 0.3, v = {1}, a = {2};\n  double f;\n"
                  "  {0}_force(&q, &v, &a, &f);\n  printf(\"%.17g\", f);\n  return 0;\n}}\n",
                  name, v, a));
  const std::string command = fmt::format(
      "cd '{}' && cc -std=c99 -Wall -Wextra -Werror main.c {}.c -lm -o program && ./program > out",
      folder, name);
  EXPECT_EQ(std::system(command.c_str()), 0);
  return std::stod(read_text(folder + "out"));
}

// A fit's values, with the elements that were fitted beside the model, make a model that predicts
// as the fit said, and that can be exported.
TEST_F(ExportCommand, AFitWritesAModelThatCanBeExported) {
  const std::string drive = kExamples + "fit/drive";
  const testing::Outcome outcome =
      graybox("fit " + drive + "/motor.yaml " + drive + " --physics " + drive +
              "/friction.yaml --json -o fit.json --write fitted.yaml");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json fit = Json::parse(outcome.out);
  const LumpedModel model = load_lumped_model(folder_.file("fitted.yaml"));
  ASSERT_EQ(model.parameters.size(), 4U);  // with the friction's transition velocity
  for (const Json& parameter : fit["parameters"]) {
    const auto same = std::ranges::find(model.parameters, parameter["name"].get<std::string>(),
                                        &LumpedParameter::name);
    ASSERT_NE(same, model.parameters.end()) << parameter;
    EXPECT_EQ(same->value, parameter["value"].get<double>()) << parameter;
  }
  ASSERT_EQ(graybox("export fitted.yaml --to c -o fitted.c").exit_code, 0);
  const double v = -3.0, a = 17.0;
  const double force =
      model.mass(0, 0) * a + model.damping(0, 0) * v + model.elements[0].law->force(0.3, v, {});
  EXPECT_NEAR(force_of(folder_.file(""), "fitted", v, a), force, 1e-9 * std::abs(force));
}

// The same motor as a rigid robot, whose inertia is a base parameter: of a fit, and of a diagnosis.
TEST_F(ExportCommand, TakesBaseParametersOfFitsAndDiagnoses) {
  const std::string drive = kExamples + "fit/drive";
  testing::write_text(folder_.file("axis.yaml"), R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints: [{name: motor, alpha: 0, a: 0, d: 0, gear_ratio: 2, rotor_inertia: unknown}]
channels: {torque: [torque], torque_of: motors, velocity: [speed], position_of: motors}
elements:
  - {name: oil, location: {kind: element, joint: motor, axis: motor}, law: viscous,
     parameters: {damping: {value: 0, unit: N m s/rad}}}
)");
  const testing::Outcome fitted = graybox("fit axis.yaml " + drive + " --json --write fitted.yaml");
  ASSERT_EQ(fitted.exit_code, 0) << fitted.err;
  double inertia = 0.0, damping = 0.0;
  const Json fit = Json::parse(fitted.out);
  for (const Json& parameter : fit["parameters"]) {
    (parameter["unit"] == "kg m^2" ? inertia : damping) = parameter["value"].get<double>();
  }
  ASSERT_NE(inertia, 0.0);
  ASSERT_NE(damping, 0.0);
  ASSERT_EQ(graybox("export fitted.yaml --to c -o fitted.c").exit_code, 0);
  const double force = inertia * 17.0 - 2.0 * 2.0 * damping * 3.0;  // both sides of the gear
  EXPECT_NEAR(force_of(folder_.file(""), "fitted", -3.0, 17.0), force, 1e-9 * std::abs(force));
  EXPECT_NE(read_text(folder_.file("fitted.c")).find("void fitted_motors("), std::string::npos);

  const testing::Outcome found = graybox("diagnose axis.yaml " + drive + " -o report");
  ASSERT_NE(found.exit_code, 2) << found.err;
  const testing::Outcome exported =
      graybox("export report/model_extended.yaml --to c --name found -o found.c");
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  const RigidRobotModel model = load_rigid_robot(folder_.file("report/model_extended.yaml"));
  double friction = 0.0;
  for (const Element& element : model.elements) {
    friction +=
        element.location.output(0) * element.law->force(0.0, -3.0 * element.location.input(0), {});
  }
  const std::string text = read_text(folder_.file("report/model_extended.yaml"));
  const std::size_t at = text.find("value: ", text.find("base_parameters:"));
  const double own = std::stod(text.substr(at + 7)) * 17.0 + friction;
  EXPECT_NEAR(force_of(folder_.file(""), "found", -3.0, 17.0), own, 1e-9 * std::abs(own));
}

TEST_F(ExportCommand, WritesAUrdfThatItReadsAgain) {
  const std::string urdf = std::string(GRAYBOX_SOURCE_DIR) + "/problems/robot/three_axis.urdf";
  const auto model = [](const std::string& file, const std::string& elements) {
    return "format: graybox-rigid-robot/1\ngravity: [0, 0, -9.81]\nurdf: " + file +
           "\nbase: base_link\ntip: flange\njoints:\n"
           "  - {name: joint_1, gear_ratio: 100, rotor_inertia: 1e-3}\n"
           "  - {name: joint_2, gear_ratio: 1, rotor_inertia: 0}\n"
           "  - {name: joint_3, gear_ratio: 1, rotor_inertia: 0}\n" +
           elements;
  };
  const std::string payload =
      "elements:\n  - {name: tool, location: {kind: element, axis: flange}, law: payload,\n"
      "     parameters: {mass: {value: 2, unit: kg}, x: {value: 0.3, unit: m}, y: {value: 0, unit: "
      "m}, z: {value: 0.1, unit: m}}}\n";
  testing::write_text(folder_.file("arm.yaml"), model(urdf, payload));
  const testing::Outcome outcome = graybox("export arm.yaml --to urdf -o with_tool.urdf");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out, "wrote with_tool.urdf\n");
  EXPECT_EQ(outcome.err,
            "note: a URDF has no rotor inertia: that of joint_1 is 0.001 kg m^2 on the motor's "
            "side\n");
  // The bodies of the new file are those of the old one with the tool.
  testing::write_text(folder_.file("again.yaml"), model("with_tool.urdf", ""));
  const testing::Outcome before = graybox("export arm.yaml --to c --without tool --name arm");
  const testing::Outcome again = graybox("export again.yaml --to c --name arm");
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_NE(before.out.substr(before.out.find("body[3][10]")),
            again.out.substr(again.out.find("body[3][10]")));
  EXPECT_EQ(load_rigid_robot(folder_.file("again.yaml")).joints.back().body->mass, 8.0 + 2.0);
}

TEST_F(ExportCommand, RefusesInOneLine) {
  const std::string drive = kExamples + "fit/drive/motor.yaml";
  expect_refused("export " + drive + " --to urdf -o x.urdf", "has no URDF");
  expect_refused("export " + drive + " --to c -o x.c --without oil",
                 "no element 'oil'; there are 'bearing'");
  expect_refused("export " + drive + " --to c --name 2x", "is no name in C");
  expect_refused("export " + drive, "--to is required");
  expect_refused("export " + drive + " --to csv --velocity -1", "-1 must be a positive number");
  expect_refused("export missing.yaml --to c", "missing.yaml");
  expect_refused(
      "export " + std::string(GRAYBOX_SOURCE_DIR) + "/problems/robot/three_axis.yaml --to c",
      "graybox-robot/1");
  expect_refused("export " + kExamples + "rigid/tx40.yaml --to c",
                 "export the model_extended.yaml");
  expect_refused("export " + kExamples + "rigid/ur10e.yaml --to c", "the gains of the drives");
}

// No model of the examples makes the program fail in another way than by one line.
TEST_F(ExportCommand, TakesOrRefusesEveryModelOfTheExamples) {
  int taken = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kExamples)) {
    const std::string file = entry.path().string();
    if (entry.path().extension() != ".yaml" ||
        read_text(file).find("format: graybox-rigid-robot/1") == std::string::npos) {
      continue;
    }
    for (const std::string kind : {"c", "csv", "urdf"}) {
      const testing::Outcome outcome = graybox("export '" + file + "' --to " + kind);
      EXPECT_TRUE(outcome.exit_code == 0 || outcome.exit_code == 2) << file << outcome.err;
      EXPECT_EQ(outcome.err.find("internal error"), std::string::npos) << file << outcome.err;
      taken += outcome.exit_code == 0 ? 1 : 0;
    }
  }
  EXPECT_GT(taken, 2);
}

}  // namespace
}  // namespace graybox
