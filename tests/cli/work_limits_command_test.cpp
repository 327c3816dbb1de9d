// Work without end and memory beyond what is there are refused or limited, in one line.
#include <algorithm>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::write_text;

const std::string kExamples = GRAYBOX_SOURCE_DIR "/docs/examples/";
const std::string kDrive = kExamples + "simulate/drive.yaml";

class WorkLimits : public testing::CommandRunner {
 protected:
  void write_plan(const std::string& lines) {
    write_text(folder_.file("plan.yaml"),
               "format: graybox-plan/1\nlevels: [2]\n" + lines +
                   "\nfrequencies: {from: 10, to: 80, count: 5, spacing: linear}\n");
  }
  void write_drive(const std::string& stiffness, const std::string& friction) {
    write_text(folder_.file("drive.yaml"),
               R"(format: graybox-lumped/1
sample_time: 0.001
motion: rotation
masses: {motor: 0.0021, load: 0.035}
elements:
  - name: shaft
    location: {kind: element, between: [motor, load]}
    law: stiffness
    parameters: {stiffness: {value: )" +
                   stiffness + R"(, unit: N m/rad}}
  - name: friction
    location: {kind: element, mass: load}
    law: coulomb
    parameters: {level: {value: )" +
                   friction + R"(, unit: N m}, transition_velocity: {value: 0.001, unit: rad/s}}
inputs:
  - {name: torque, mass: motor}
outputs:
  - {name: speed, mass: motor, quantity: velocity}
)");
  }
};

// Finding C2: said before FFTW runs out of memory, with the largest period that fits.
TEST_F(WorkLimits, APeriodBeyondMemoryIsRefusedWithTheLargestThatFits) {
#ifdef GRAYBOX_SANITIZED
  GTEST_SKIP() << "the address sanitizer takes all addresses for itself";
#endif
  write_plan("period: 200000000");
  const std::string arguments = "simulate " + kDrive + " plan.yaml -o x";
  const Outcome outcome = graybox(arguments, "ulimit -v 3000000 &&");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
  EXPECT_NE(outcome.err.find("plan.yaml:3: period: "), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("at most "), std::string::npos) << outcome.err;
  EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
}

// Finding C2.
TEST_F(WorkLimits, ACountBeyondTheLargestNamesIt) {
  write_plan("period: 2147483648");
  expect_refused("simulate " + kDrive + " plan.yaml -o x",
                 "period: must be a whole number from 1 to 1000000000, is 2147483648");
}

// Finding C6.
TEST_F(WorkLimits, SettlingForEverIsRefused) {
  write_plan("period: 1000\nsettling_periods: 1000000000");
  expect_refused("simulate " + kDrive + " plan.yaml -o x", "settling_periods: ");
}

// Finding C6: a shaft and a friction that no integrator can follow.
TEST_F(WorkLimits, AMotionTooStiffToFollowIsAnswered) {
  write_plan("period: 1000");
  write_drive("1e12", "0.1");
  Outcome outcome = graybox("simulate drive.yaml plan.yaml -o x");
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_NE(outcome.err.find("too stiff"), std::string::npos) << outcome.err;
  write_drive("45", "4e9");
  outcome = graybox("simulate drive.yaml plan.yaml -o y");
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_NE(outcome.err.find("too stiff"), std::string::npos) << outcome.err;
}

// Finding E5.
TEST_F(WorkLimits, ALongFormulaIsNotPrintedInFull) {
  std::string formula = "k*z";
  for (int i = 0; i < 100000; ++i) formula += "+1*z";
  write_text(folder_.file("laws.yaml"),
             "format: graybox-laws/1\nlaws:\n  - {name: long, description: d, force: \"" + formula +
                 " + (\", parameters: {k: {unit: F/x}}}\n");
  const Outcome outcome =
      graybox("diagnose " + kDrive + " " + kExamples + "responses --laws laws.yaml");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.err.substr(0, 300);
  EXPECT_LT(outcome.err.size(), 1200U);
  EXPECT_NE(outcome.err.find("laws.yaml"), std::string::npos) << outcome.err;
}

// Finding E6: file, field and remedy.
TEST_F(WorkLimits, MessagesNameFileAndField) {
  write_plan("period: 1000");
  write_text(folder_.file("hidden.yaml"), R"(format: graybox-physics/1
elements:
  - name: late
    location: {kind: actuator, input: torque}
    law: delay
    parameters: {time: {value: 1e308, unit: s}}
)");
  const Outcome outcome = graybox("simulate " + kDrive + " plan.yaml --hidden hidden.yaml -o x");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.err.find("hidden.yaml"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("delay"), std::string::npos) << outcome.err;
  expect_refused("problem robot --grid 0 -o x.h5", "--grid 0: ");
}

// Finding E6: a recording that is too short for a step of its campaign file.
TEST_F(WorkLimits, AStepThatARecordingIsTooShortForNamesBothFiles) {
  write_text(folder_.file("short.csv"), "time,speed\n0,1\n0.1,2\n");
  write_text(folder_.file("campaign.yaml"), R"(format: graybox-campaign/1
sample_time: 0.1
channels: [{name: speed, unit: rad/s, is: output}]
experiments: [{file: short.csv}]
preprocess: [{kind: derivative, of: [speed], name: [acceleration]}]
)");
  expect_refused("recordings campaign.yaml",
                 "campaign.yaml: short.csv: preprocess: derivative needs at least three samples");
}

// Finding E6: a robot that can't carry itself.
TEST_F(WorkLimits, AnArmThatFindsNoEquilibriumNamesTheRobotAndTheField) {
  const std::string source = std::string(GRAYBOX_SOURCE_DIR) + "/problems/robot/";
  std::string model = read_text(source + "irb6600_like.yaml");
  const std::string stiff = "stiffness: 2.12e6";
  ASSERT_NE(model.find(stiff), std::string::npos);
  model.replace(model.find(stiff), stiff.size(), "stiffness: 10");
  write_text(folder_.file("soft.yaml"), model);
  write_text(folder_.file("irb6600_like.urdf"), read_text(source + "irb6600_like.urdf"));
  const Outcome outcome = graybox("problem robot --model soft.yaml --grid 10 -o x.h5");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.err.find("soft"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("'stiffness'"), std::string::npos) << outcome.err;
}

// Finding E9.
TEST_F(WorkLimits, AGridOfANumberWithExponentIsANumber) {
  EXPECT_EQ(graybox("problem robot --grid 4e1 -o small.h5").exit_code, 0);
  expect_refused("problem robot --grid 1e9 -o x.h5", "--grid 1e9: ");
  expect_refused("problem robot --grid 1e400 -o x.h5", "--grid 1e400: ");
  expect_refused("problem robot --grid 2.5 -o x.h5", "--grid 2.5: ");
  expect_refused("problem robot --grid nowhere.csv -o x.h5", "nowhere.csv: no such file");
}

}  // namespace
}  // namespace graybox
