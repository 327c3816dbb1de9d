// `graybox design plan`: what is written is a design that `check` and `--done` take.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using Json = nlohmann::json;

class PlanCommand : public testing::CommandRunner {
 protected:
  void SetUp() override {
    const testing::Outcome made =
        graybox("problem random --family wis --candidates 60 --dimension 4 --seed 3 -o set.h5");
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
};

TEST_F(PlanCommand, ReachesWhatWasAskedAndLeavesADesignForOthers) {
  const testing::Outcome planned =
      graybox("design plan set.h5 --target 'sd(all) <= 0.2' --detect '0 by 1' -o plan.json --json");
  ASSERT_EQ(planned.exit_code, 0) << planned.err << planned.out;
  const Json plan = Json::parse(planned.out);
  EXPECT_EQ(plan["status"], "proven");
  EXPECT_EQ(plan["least_experiments"], plan["experiments"]);
  ASSERT_EQ(plan["targets"].size(), 5U);
  for (const Json& target : plan["targets"]) {
    EXPECT_LE(target["standard_error"].get<double>(),
              target["standard_error_asked"].get<double>() * (1.0 + 1e-9));
  }
  EXPECT_GE(plan["targets"][4]["power"].get<double>(), 0.9);
  EXPECT_EQ(graybox("check set.h5 plan.json").exit_code, 0);
  // With these done, hardly any is left to do for a little more.
  const testing::Outcome next =
      graybox("design plan set.h5 --target 'sd(all) <= 0.198' --done plan.json --json");
  ASSERT_EQ(next.exit_code, 0) << next.err << next.out;
  EXPECT_LT(Json::parse(next.out)["experiments"].get<int>(), plan["experiments"].get<int>() / 2);
}

TEST_F(PlanCommand, MoreNoiseAsksForItsSquareOfExperiments) {
  const auto needed = [&](const std::string& options) {
    const testing::Outcome outcome =
        graybox("design plan set.h5 --target 'sd(1) <= 0.2' --json " + options);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
    return Json::parse(outcome.out)["experiments"].get<double>();
  };
  EXPECT_NEAR(needed("--noise 4") / needed("--noise 1"), 16.0, 4.0);
}

TEST_F(PlanCommand, FindsTheCheapestExperiments) {
  std::string costs;
  for (int i = 0; i < 60; ++i) costs += i % 3 == 0 ? "5\n" : "20\n";
  testing::write_text(folder_.file("minutes.csv"), costs);
  const std::string ask = "design plan set.h5 --target 'sd(0) <= 0.3' --costs minutes.csv ";
  const testing::Outcome planned = graybox(ask + "--json -o plan.json");
  ASSERT_EQ(planned.exit_code, 0) << planned.err << planned.out;
  const Json plan = Json::parse(planned.out);
  double cost = 0.0;
  for (const Json& run : plan["counts"]) {
    cost += run["count"].get<double>() * (run["index"].get<int>() % 3 == 0 ? 5.0 : 20.0);
  }
  EXPECT_DOUBLE_EQ(plan["cost"].get<double>(), cost);
  EXPECT_EQ(plan["cost"], plan["least_cost"]);  // multiples of five minutes
  EXPECT_EQ(graybox("check set.h5 plan.json").exit_code, 0);
  const testing::Outcome poor = graybox(ask + "--budget " + std::to_string(cost - 5.0));
  EXPECT_EQ(poor.exit_code, 1);
  EXPECT_NE(poor.out.find("reaches every target: proven"), std::string::npos) << poor.out;
}

TEST_F(PlanCommand, WhatIsKnownMayBeEnough) {
  ASSERT_EQ(graybox("exact set.h5 --experiments 40 -o done.json").exit_code, 0);
  for (const std::string options : {"", " --costs 2"}) {
    const testing::Outcome planned =
        graybox("design plan set.h5 --target 'sd(0) <= 1' --done done.json --json" + options);
    ASSERT_EQ(planned.exit_code, 0) << planned.err << planned.out;
    EXPECT_EQ(Json::parse(planned.out)["experiments"], 0);
  }
}

TEST_F(PlanCommand, WritesACurve) {
  const testing::Outcome outcome = graybox(
      "design plan set.h5 --target 'sd(0) <= 0.1' --detect '1 by 0.4' --experiments 6,12,40 "
      "--table curve.csv");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::string table = testing::read_text(folder_.file("curve.csv"));
  EXPECT_EQ(table.substr(0, table.find('\n')),
            "experiments,least_worst_ratio,worst_ratio,\"sd(0)\",\"sd(1)\",\"power(1)\"");
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 4);
}

TEST_F(PlanCommand, SaysWhatCantBe) {
  const testing::Outcome far = graybox("design plan set.h5 --target 'sd(0) <= 1e-6' --at-most 99");
  EXPECT_EQ(far.exit_code, 1);
  EXPECT_NE(far.out.find("no design of 99 experiments or fewer reaches every target: proven"),
            std::string::npos)
      << far.out;
  expect_refused("design plan set.h5", "target: say what is to be reached, as 'sd(k1) <= 0.02'");
  expect_refused("design plan set.h5 --target 'sd(9) <= 1'", "9");
  expect_refused("design plan set.h5 --target 'sd(0) <= 1' --budget 3",
                 "budget: say what each experiment costs (costs)");
  expect_refused("design plan set.h5 --target 'sd(0) <= 1' --costs 1 --experiments 4 --table t.csv",
                 "--table counts experiments, without costs");
  expect_refused("design plan set.h5 --target 'sd(0) <= 1' --noise 0", "noise: a positive factor");
  expect_refused("design plan set.h5 --detect '0 by 1' --power 1.5", "power: it lies between");
  expect_refused("design plan set.h5 --target 'sd(0) <= 1' --table t.csv", "--experiments LIST");
}

}  // namespace
}  // namespace graybox
