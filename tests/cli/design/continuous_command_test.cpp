// `graybox design continuous` and `graybox design sequential` as users see them.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using Json = nlohmann::json;

class ContinuousCommands : public testing::CommandRunner {
 protected:
  static long lines(const std::string& text) { return std::ranges::count(text, '\n'); }
  // The robot with 6 frequencies instead of 50, and five positions that differ in q2 and q3: quick.
  void SetUp() override {
    const auto robot = std::filesystem::path(GRAYBOX_SOURCE_DIR) / "problems" / "robot";
    std::string text = testing::read_text((robot / "irb6600_like.yaml").string());
    const std::string frequencies = "count: 50";
    ASSERT_NE(text.find(frequencies), std::string::npos);
    text.replace(text.find(frequencies), frequencies.size(), "count: 6");
    testing::write_text(models_.file("quick.yaml"), text);
    std::filesystem::copy(robot / "irb6600_like.urdf", models_.file("irb6600_like.urdf"));
  }
  [[nodiscard]] std::string model() const { return " --model " + models_.file("quick.yaml") + " "; }
  void write_grid() {
    testing::write_text(folder_.file("grid.csv"),
                        "q1,q2,q3,q4,q5,q6\n45,-30,-75,0,-45,0\n45,15,-150,0,-45,0\n"
                        "45,30,30,0,-45,0\n45,-15,-45,0,-45,0\n45,60,-90,0,-45,0\n");
  }

  testing::TemporaryFolder models_;
};

TEST_F(ContinuousCommands, ContinuousDesignIsCertifiedByTheChecker) {
  write_grid();
  const testing::Outcome outcome = graybox(
      "design continuous" + model() +
      "--grid grid.csv --joint-limit q1=45:45 --joint-limit q4=0:0 --joint-limit q5=-45:-45 "
      "--gap 0.1 --starts 2 --random-points 5 --refined 400 --refinement 7920 --samples 5 "
      "--seed 3 -o design.json --set set.h5 --tables t --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(lines(outcome.out), 1);
  const Json report = Json::parse(outcome.out);
  EXPECT_EQ(report["status"], "solved");
  EXPECT_EQ(report["seed"], 3);
  EXPECT_LE(report["found_gap"].get<double>(), 0.1);
  EXPECT_LE(report["covariance"].get<double>(), report["grid_covariance"].get<double>());
  EXPECT_EQ(report["refined"].size(), 1U);
  const testing::Outcome checked = graybox("check set.h5 design.json --json");
  EXPECT_EQ(checked.exit_code, 0) << checked.err;
  const Json check = Json::parse(checked.out);
  EXPECT_NEAR(check["duality_gap"].get<double>(), report["duality_gap"].get<double>(), 1e-12);
  for (const char* table :
       {"t_support.csv", "t_rounds.csv", "t_bound.csv", "t_refinement.csv", "t_sensitivity.csv"}) {
    EXPECT_GE(lines(testing::read_text(folder_.file(table))), 2) << table;
  }
}

TEST_F(ContinuousCommands, ContinuousRefusesBadLimits) {
  write_grid();
  const std::string command =
      "design continuous --grid grid.csv --refined 10 --random-points 10 -o d.json ";
  expect_refused(command + "--joint-limit q2=90:-60", "q2: 90 to -60");
  expect_refused(command + "--joint-limit q2=-60:95", "beyond the limits of the URDF");
  expect_refused(command + "--joint-limit q7=0:1", "--joint-limit");
  expect_refused(command + "--joint-limit q2=0", "--joint-limit");
  expect_refused(command + "--joint-limit q1=1:2", "no position of the grid lies inside");
  expect_refused(command + "--limits paper2", "--limits");
  expect_refused(command + "--gap 0", "gap");
  expect_refused("design continuous --model missing.yaml", "missing.yaml");
  expect_refused("design continuous --grid missing.csv", "missing.csv");
}

TEST_F(ContinuousCommands, SequentialWritesItsTables) {
  const testing::Outcome outcome =
      graybox("design sequential" + model() +
              "--grid 100 --stages 1 --experiments-per-stage 14 --repetitions 1 --start-error 0.1 "
              "--noise 1e-6 -o stages.csv --summary summary.csv --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(lines(outcome.out), 1);
  const Json report = Json::parse(outcome.out);
  EXPECT_EQ(report["repetitions"], 1);
  EXPECT_EQ(report["summary"].size(), 4U * 2U);
  EXPECT_EQ(lines(testing::read_text(folder_.file("stages.csv"))), 1 + 4 * 2);
  EXPECT_EQ(lines(testing::read_text(folder_.file("summary.csv"))), 1 + 4 * 2);
}

TEST_F(ContinuousCommands, SequentialRefusesBadOptions) {
  const std::string command = "design sequential" + model() + "--grid 50 -o s.csv ";
  expect_refused(command + "--stages 0", "stages");
  expect_refused(command + "--experiments-per-stage 0", "experiments");
  expect_refused(command + "--repetitions 0", "repetitions");
  expect_refused(command + "--start-error 1", "start error");
  expect_refused(command + "--start-error -0.1", "start error");
  expect_refused(command + "--noise 0", "--noise");
  expect_refused(command + "--threads 0", "threads");
  expect_refused("design sequential --model missing.yaml", "missing.yaml");
}

}  // namespace
}  // namespace graybox
