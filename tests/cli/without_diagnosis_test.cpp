// A program that was built without the diagnosis (GRAYBOX_WITH_DIAGNOSIS=OFF), as users see it.
#include "tests/support/command_runner.hpp"

namespace graybox::testing {
namespace {

class WithoutDiagnosis : public CommandRunner {};

TEST_F(WithoutDiagnosis, AbsentCommandsSaySoInOneLine) {
  for (const std::string command :
       {"simulate", "recordings", "responses", "fit", "predict", "model", "diagnose", "export",
        "challenge", "design sequential", "design verify"}) {
    expect_refused(command, "'" + command + "' is not in this program");
    expect_refused(command + " model.yaml -o x", "GRAYBOX_WITH_DIAGNOSIS=ON");
    expect_refused("help " + command, "GRAYBOX_WITH_DIAGNOSIS=ON");
  }
  expect_refused("diagnos", "unknown command 'diagnos'");
}

TEST_F(WithoutDiagnosis, HelpNamesNoAbsentCommand) {
  for (const char* arguments : {"", "--help", "design --help", "completion bash"}) {
    const Outcome outcome = graybox(arguments);
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_NE(outcome.out.find("graybox"), std::string::npos) << arguments << outcome.out;
    for (const char* command : {"diagnose", "simulate", "sequential", "graybox model"}) {
      EXPECT_EQ(outcome.out.find(command), std::string::npos) << arguments << ": " << command;
    }
  }
}

TEST_F(WithoutDiagnosis, DesignsAreMadeAndCheckedWithTheirPage) {
  EXPECT_EQ(graybox("problem robot --grid 30 -o set.h5").exit_code, 0);
  EXPECT_EQ(graybox("solve set.h5 -o design.json --report design.html").exit_code, 0);
  EXPECT_EQ(graybox("check set.h5 design.json").exit_code, 0);
  EXPECT_EQ(graybox("exact set.h5 --experiments 8").exit_code, 0);
}

}  // namespace
}  // namespace graybox::testing
