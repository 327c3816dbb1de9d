// `solve`, `check` and `exact` under constraints, as users and scripts see them.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::read_text;
using testing::write_text;
using Json = nlohmann::json;

class ConstrainedCommand : public testing::CommandRunner {
 protected:
  void SetUp() override {
    const testing::Outcome made =
        graybox("problem random --family wis --candidates 60 --dimension 4 --seed 3 -o set.h5");
    ASSERT_EQ(made.exit_code, 0) << made.err;
    write_text(folder_.file("request.yaml"),
               "format: graybox-request/1\nexperiments: 12\nstock: 2\nforbid: 3-5\n"
               "constraints:\n  - {name: first half, candidates: 0-29, at_most: 30 %}\n");
  }

  Json run(const std::string& arguments, int exit_code = 0) {
    const testing::Outcome outcome = graybox(arguments);
    EXPECT_EQ(outcome.exit_code, exit_code) << arguments << ": " << outcome.err;
    EXPECT_EQ(outcome.err, "") << arguments;
    return Json::parse(outcome.out, nullptr, false);
  }
};

TEST_F(ConstrainedCommand, SolvesAndChecksARequest) {
  const Json solved = run("solve set.h5 --request request.yaml --gap 1e-9 --json -o design.json");
  EXPECT_EQ(solved["status"], "solved");
  EXPECT_NEAR(solved["experiments"].get<double>(), 12.0, 1e-9);
  EXPECT_EQ(solved["multipliers"][1]["name"], "first half");
  EXPECT_LE(solved["multipliers"][1]["value"].get<double>(), 3.6 + 1e-9);
  const Json checked = run("check set.h5 design.json --json");
  EXPECT_EQ(checked["status"], "solved");
  EXPECT_NEAR(checked["log_det"].get<double>(), solved["log_det"].get<double>(), 1e-9);
  // Held to another request it is no design, or not the best.
  EXPECT_EQ(graybox("check set.h5 design.json --experiments 12 --stock 0.5").exit_code, 1);
  EXPECT_EQ(graybox("check set.h5 design.json --experiments 12").exit_code, 1);
}

TEST_F(ConstrainedCommand, OptionsSayTheSameAsTheFile) {
  write_text(folder_.file("rows.yaml"),
             "constraints:\n  - {name: first half, candidates: 0-29, at_most: 30 %}\n");
  const Json file = run("solve set.h5 --request request.yaml --json");
  const Json options =
      run("solve set.h5 --experiments 12 --stock 2 --forbid 3-5 --constraints rows.yaml --json");
  EXPECT_EQ(file["log_det"], options["log_det"]);
}

TEST_F(ConstrainedCommand, DesignsAreWhatComesNext) {
  run("exact set.h5 --experiments 5 --stock 1 --json -o first.json");
  const Json next =
      run("exact set.h5 --experiments 3 --done first.json --top 3 --json -o next.json");
  EXPECT_EQ(next["status"], "optimal");
  ASSERT_EQ(next["designs"].size(), 3U);
  EXPECT_EQ(next["designs"][0]["efficiency"], 1.0);
  EXPECT_LE(next["designs"][2]["efficiency"].get<double>(), 1.0);
  const Json checked = run("check set.h5 next.json --json");
  EXPECT_GT(checked["proven_efficiency"].get<double>(), 0.5);
  EXPECT_LE(checked["proven_efficiency"].get<double>(), 1.0);
}

// No whole numbers are better than the relaxed design of the same request.
TEST_F(ConstrainedCommand, EveryCriterionHasWholeNumbers) {
  write_text(folder_.file("axes.csv"), "1,0,0,0\n0,1,0,0\n0,0,1,0\n0,0,0,1\n");
  for (const std::string criterion : {"E", "G --region axes.csv", "phi_p --p 3", "D=0.5,E=0.5",
                                      "A=0.5,G=0.5 --region axes.csv"}) {
    SCOPED_TRACE(criterion);
    const std::string asked = " set.h5 --request request.yaml --criterion " + criterion;
    const Json relaxed = run("solve" + asked + " --gap 1e-5 --json");
    const Json whole = run("exact" + asked + " --gap 0.03 --json -o whole.json");
    EXPECT_EQ(relaxed["status"], "solved");
    EXPECT_EQ(whole["status"], "optimal");
    EXPECT_GE(whole["proven_efficiency"].get<double>(), 1.0 / 1.03 - 1e-9);
    const bool rises = criterion.front() == 'E' || criterion.find('=') != std::string::npos;
    const double loss =
        relaxed["criterion_value"].get<double>() - whole["criterion_value"].get<double>();
    EXPECT_GE(rises ? loss : -loss, -1e-5 * std::abs(relaxed["criterion_value"].get<double>()));
    const Json checked = run("check set.h5 whole.json --json");
    EXPECT_EQ(checked["criterion_value"], whole["criterion_value"]);
    EXPECT_LE(checked["proven_efficiency"].get<double>(), 1.0);
    EXPECT_GT(checked["proven_efficiency"].get<double>(), 0.7);
  }
}

TEST_F(ConstrainedCommand, FilesMoveTogetherAndMustNotChange) {
  std::filesystem::create_directory(folder_.file("campaign"));
  std::string costs;
  for (int i = 0; i < 60; ++i) costs += std::to_string(1 + i % 7) + "\n";
  write_text(folder_.file("campaign/costs.csv"), costs);
  run("solve set.h5 --costs campaign/costs.csv --budget 40 --json -o campaign/design.json");
  std::filesystem::rename(folder_.file("campaign"), folder_.file("archive"));
  run("check set.h5 archive/design.json --json");
  write_text(folder_.file("archive/costs.csv"), "9\n" + costs.substr(costs.find('\n') + 1));
  expect_refused("check set.h5 archive/design.json", "have changed since it was made");
}

TEST_F(ConstrainedCommand, AnotherProgramsDesignIsChecked) {
  run("solve set.h5 --request request.yaml --gap 1e-9 --json -o design.json");
  Json design = Json::parse(read_text(folder_.file("design.json")));
  const Json plain{{"format", "graybox-design/1"}, {"support", design["support"]}};
  write_text(folder_.file("other.json"), plain.dump());
  EXPECT_EQ(run("check set.h5 other.json --request request.yaml --gap 1e-8 --json")["status"],
            "solved");
  design["support"][0]["weight"] = design["support"][0]["weight"].get<double>() + 1e-3;
  write_text(folder_.file("wrong.json"), design.dump());
  EXPECT_EQ(graybox("check set.h5 wrong.json").exit_code, 1);
}

TEST_F(ConstrainedCommand, WhatDoesNotFitIsRefusedInOneLine) {
  expect_refused("solve set.h5 --experiments 12 --stock 0.1", "can't be met");
  expect_refused("solve set.h5 --stock 1", "stock counts experiments");
  expect_refused("solve set.h5 --experiments 3 --forbid 60", "beyond the last candidate");
  expect_refused("solve set.h5 --experiments 3 --forbid 'q1 > 2'", "coordinates");
  expect_refused("solve set.h5 --experiments 3 --solver multiplicative", "column_generation");
  expect_refused("solve set.h5 --request missing.yaml", "missing.yaml");
  expect_refused("exact set.h5", "experiments");
  expect_refused("exact set.h5 --top 2", "experiments");
  expect_refused("exact set.h5 --experiments 3 --top 2 --method rounding", "branch_and_bound");
}

}  // namespace
}  // namespace graybox
