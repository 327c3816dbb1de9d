// `graybox export` as users run it: after a diagnosis, into files and to the screen.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>

#include "problems/mechanisms/lumped_model.hpp"
#include "tests/support/command_runner.hpp"
#include "tests/support/quoted_listing.hpp"

namespace graybox {
namespace {

using testing::read_text;

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
  testing::expect_quoted("docs/export.md", source, "/* found coulomb");
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

TEST_F(ExportCommand, RefusesInOneLine) {
  const std::string drive = kExamples + "fit/drive/motor.yaml";
  expect_refused("export " + drive + " --to urdf -o x.urdf", "has no URDF");
  expect_refused("export " + drive + " --to c -o x.c --without oil",
                 "no element 'oil'; there are 'bearing'");
  expect_refused("export " + drive + " --to c --name 2x", "is no name in C");
  expect_refused("export " + drive, "--to is required");
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
