// What long design commands say on a terminal while they work, and after a signal.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/support/terminal_run.hpp"

namespace graybox {
namespace {

using testing::Outcome;

// What does not end by then is killed, exit code 137.
const std::string kAfterThreeSeconds =
    "timeout --foreground --preserve-status --signal=INT --kill-after=20 3";

class DesignProgress : public testing::TerminalRunner {
 protected:
  // The robot with 6 frequencies instead of 50: quick.
  void SetUp() override {
    const auto robot = std::filesystem::path(GRAYBOX_SOURCE_DIR) / "problems" / "robot";
    std::string text = testing::read_text((robot / "irb6600_like.yaml").string());
    const std::string frequencies = "count: 50";
    ASSERT_NE(text.find(frequencies), std::string::npos);
    text.replace(text.find(frequencies), frequencies.size(), "count: 6");
    testing::write_text(models_.file("quick.yaml"), text);
    std::filesystem::copy(robot / "irb6600_like.urdf", models_.file("irb6600_like.urdf"));
  }
  [[nodiscard]] std::string quick() const { return " --model " + models_.file("quick.yaml") + " "; }

  static void expect_shown(const Outcome& outcome, const std::string& text) {
    EXPECT_NE(outcome.err.find(text), std::string::npos) << text << " is not in\n" << outcome.err;
  }
  static void expect_interrupted(const Outcome& outcome) {
    EXPECT_TRUE(outcome.exit_code == 1 || outcome.exit_code == 130) << outcome.exit_code;
    const std::string all = outcome.out + outcome.err;
    EXPECT_NE(all.find("interrupted"), std::string::npos) << all;
    EXPECT_EQ(all.find("time_limit"), std::string::npos) << all;
  }

  testing::TemporaryFolder models_;
};

TEST_F(DesignProgress, SequentialNamesItsSetsAndCountsItsStages) {
  const std::string command = "design sequential" + quick() +
                              "--grid 100 --stages 2 --experiments-per-stage 14 --repetitions 4 "
                              "--start-error 0.1 --noise 1e-6";
  const Outcome outcome = at_terminal(command);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  expect_shown(outcome, "information matrices of ");
  expect_shown(outcome, "stage 0 of 32");
  expect_shown(outcome, " left");
  EXPECT_EQ(graybox(command).err, "");  // quiet in a pipe
}

TEST_F(DesignProgress, SequentialSaysInterrupted) {
  expect_interrupted(graybox("design sequential --repetitions 500", kAfterThreeSeconds));
}

TEST_F(DesignProgress, VerifyNamesItsSetsAndCountsItsFits) {
  const Outcome outcome = at_terminal(
      "design verify --grid 500 --recordings 0 --repetitions 100000 -o rows", kAfterThreeSeconds);
  expect_shown(outcome, "information matrices of ");
  expect_shown(outcome, "fit of responses 0 of 220000");
  expect_interrupted(outcome);
}

TEST_F(DesignProgress, ContinuousShowsItsStages) {
  const std::string command = "design continuous" + quick() +
                              "--grid 500 --gap 0.1 --starts 2 --random-points 50 --refined 2000 "
                              "--rounds 20";
  const Outcome outcome = at_terminal(command);
  EXPECT_TRUE(outcome.exit_code == 0 || outcome.exit_code == 1) << outcome.err;
  expect_shown(outcome, "information matrices of the grid");
  expect_shown(outcome, "round 0 of at most 20");
  expect_shown(outcome, "refined grid: priced block 0 of ");
  expect_shown(outcome, "refined grid: search 0 of ");
  EXPECT_EQ(graybox(command).err, "");
}

TEST_F(DesignProgress, ContinuousSaysInterruptedNotTimeLimit) {
  expect_interrupted(graybox("design continuous --refined 4000000", kAfterThreeSeconds));
}

TEST_F(DesignProgress, RobustCountsSetsAndOptima) {
  const std::string command =
      "design robust" + quick() + "--grid 300 --samples 5 --uncertainty 0.3";
  const Outcome outcome = at_terminal(command);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  expect_shown(outcome, "information matrices of sample 0 of 5");
  expect_shown(outcome, "optimum of sample 0 of 5");
  EXPECT_EQ(graybox(command).err, "");
}

TEST_F(DesignProgress, RobustSaysInterruptedNotTimeLimit) {
  expect_interrupted(graybox("design robust --samples 400", kAfterThreeSeconds));
}

}  // namespace
}  // namespace graybox
