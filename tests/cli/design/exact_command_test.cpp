// `graybox exact` and `graybox check` on exact designs, as users and scripts see them.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::read_text;
using testing::write_text;
using Json = nlohmann::json;

class ExactCommand : public testing::CommandRunner {
 protected:
  void SetUp() override {
    const testing::Outcome made =
        graybox("problem random --family wis --candidates 60 --dimension 4 --seed 3 -o set.h5");
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }

  Json run(const std::string& arguments, int exit_code = 0) {
    const testing::Outcome outcome = graybox(arguments);
    EXPECT_EQ(outcome.exit_code, exit_code) << arguments << ": " << outcome.err;
    EXPECT_EQ(outcome.err, "") << arguments;  // quiet in a pipe
    return Json::parse(outcome.out, nullptr, false);
  }
};

TEST_F(ExactCommand, EveryMethodReportsTheSameKeys) {
  Json best = run("exact set.h5 --experiments 6 --json");
  EXPECT_EQ(best["status"], "optimal");
  EXPECT_GE(best["proven_efficiency"].get<double>(), 1.0 - 1.01e-6);
  for (const std::string method : {"rounding", "efficient_rounding", "exchange"}) {
    SCOPED_TRACE(method);
    const Json line = run("exact set.h5 -M 6 --json --method " + method);
    EXPECT_EQ(line["method"], method);
    for (const auto& [key, value] : best.items()) EXPECT_TRUE(line.contains(key)) << key;
    std::int64_t total = 0;
    for (const Json& entry : line["counts"]) total += entry["count"].get<std::int64_t>();
    EXPECT_EQ(total, 6);
    EXPECT_LE(line["log_det"].get<double>(), best["log_det_bound"].get<double>() + 1e-9);
  }
}

// Finding in section 3 of S6: keys of the relaxed problem passed for those of the exact design.
TEST_F(ExactCommand, JsonTellsTheExactDesignFromTheRelaxedProblem) {
  const Json line = run("exact set.h5 -M 6 --json -o design.json");
  const double d = line["dimension"].get<double>();
  const double log_det = line["log_det"].get<double>();
  // log det sum m_i H_i = d log M + log det sum (m_i / M) H_i.
  EXPECT_NEAR(log_det - line["relaxed_log_det"].get<double>(), d * std::log(6.0), 1e-9);
  EXPECT_NEAR(std::exp(-log_det / d), line["covariance"].get<double>(), 1e-9);
  const double efficiency = line["efficiency"].get<double>();
  EXPECT_EQ(efficiency, line["proven_efficiency"].get<double>());
  EXPECT_NEAR(1.0 / efficiency - 1.0, line["duality_gap"].get<double>(), 1e-12);
  EXPECT_LE(line["duality_gap"].get<double>(), line["asked_gap"].get<double>());
  // Six experiments are not the relaxed optimum.
  EXPECT_GT(line["relaxed_duality_gap"].get<double>(), 1e-3);
  EXPECT_LT(line["relaxed_efficiency"].get<double>(), efficiency);
  const Json file = Json::parse(read_text(folder_.file("design.json")));
  EXPECT_EQ(file["log_det"], line["log_det"]);
  EXPECT_EQ(file["certificate"]["duality_gap"], line["relaxed_duality_gap"]);
}

TEST_F(ExactCommand, DesignFilesAreCheckedAsExactDesigns) {
  const Json made = run("exact set.h5 -M 6 --json -o design.json");
  const Json file = Json::parse(read_text(folder_.file("design.json")));
  EXPECT_EQ(file["format"], "graybox-design/1");
  EXPECT_EQ(file["counts"], made["counts"]);
  for (const Json& point : file["support"]) {  // weights m / M, for readers of approximate designs
    EXPECT_NEAR(std::remainder(6.0 * point["weight"].get<double>(), 1.0), 0.0, 1e-12);
  }
  const Json checked = run("check set.h5 design.json --json");
  EXPECT_EQ(checked["log_det"], made["log_det"]);
  EXPECT_EQ(checked["stated_efficiency"], made["proven_efficiency"]);
  // The relaxation alone proves less than the tree.
  EXPECT_LE(checked["proven_efficiency"].get<double>(), made["proven_efficiency"].get<double>());
  EXPECT_GT(checked["proven_efficiency"].get<double>(), 0.5);
  EXPECT_EQ(run("check set.h5 design.json --json --gap 1e-9", 1)["counts"], made["counts"]);
}

TEST_F(ExactCommand, TamperedCountsAreRefused) {
  run("exact set.h5 -M 6 --json -o design.json");
  const Json good = Json::parse(read_text(folder_.file("design.json")));
  write_text(folder_.file("bad.json"), "{}");
  const auto refused_with = [&](const Json& bad, const std::string& text) {
    write_text(folder_.file("bad.json"), bad.dump());
    expect_refused("check set.h5 bad.json", text);
  };
  Json bad = good;
  bad["counts"][0]["count"] = -1;
  refused_with(bad, "count");
  bad = good;
  bad["counts"][0]["count"] = 1.5;
  refused_with(bad, "whole number");
  bad = good;
  bad["counts"][0]["count"] = good["counts"][0]["count"].get<int>() + 1;
  refused_with(bad, "sum to 7");
  bad = good;
  bad["counts"][0]["index"] = 60;
  refused_with(bad, "index 60");
  bad = good;
  bad["experiments"] = 7;
  refused_with(bad, "experiments is 7");
  bad = good;
  bad["support"][0]["weight"] = good["support"][0]["weight"].get<double>() + 0.01;
  refused_with(bad, "has weight");
}

TEST_F(ExactCommand, ResumesFromACheckpoint) {
  const Json whole = run("exact set.h5 -M 9 --json --checkpoint whole.cbor");
  const Json again = run("exact set.h5 -M 9 --json --checkpoint whole.cbor --resume");
  EXPECT_EQ(again["counts"], whole["counts"]);
  EXPECT_EQ(again["nodes"], whole["nodes"]);
  EXPECT_EQ(again["log_det_bound"], whole["log_det_bound"]);
}

TEST_F(ExactCommand, TimeThatIsTooShortLeavesADesignAndABound) {
  const Json line = run("exact set.h5 -M 9 --json --time-limit 1e-9", 1);
  EXPECT_EQ(line["status"], "time_limit");
  EXPECT_GT(line["proven_efficiency"].get<double>(), 0.0);
  EXPECT_GE(line["log_det_bound"].get<double>(), line["log_det"].get<double>());
}

TEST_F(ExactCommand, WritesOneLineForEachNumberOfExperiments) {
  const testing::Outcome outcome = graybox("exact set.h5 --experiments 2:4,8 --table table.csv");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  std::istringstream lines(read_text(folder_.file("table.csv")));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line.find("experiments,relaxed,rounding,"), 0U);
  for (const std::string m : {"2", "3", "4", "8"}) {
    ASSERT_TRUE(std::getline(lines, line));
    EXPECT_EQ(line.find(m + ","), 0U) << line;
    EXPECT_NE(line.find(",yes,"), std::string::npos) << line;
  }
  EXPECT_FALSE(std::getline(lines, line));
}

TEST_F(ExactCommand, RefusesBadInput) {
  expect_refused("exact set.h5", "experiments");
  expect_refused("exact none.h5 -M 3", "none.h5");
  for (const std::string m : {"0", "-1", "1.5", "x", "3,", "4:3", "nan", "99999999999999999999"}) {
    expect_refused("exact set.h5 --experiments=" + m, "experiments");
  }
  expect_refused("exact set.h5 -M 3:5", "--table");
  expect_refused("exact set.h5 -M 3:5 --table t.csv -o d.json", "--table");
  expect_refused("exact set.h5 -M 3 --method simplex", "branch_and_bound");
  expect_refused("exact set.h5 -M 3 --gap 0", "gap");
  expect_refused("exact set.h5 -M 3 --gap nan", "gap");
  expect_refused("exact set.h5 -M 3 --time-limit -1", "time limit");
  expect_refused("exact set.h5 -M 3 --threads 0", "threads");
  expect_refused("exact set.h5 -M 3 --resume", "checkpoint");
  expect_refused("exact set.h5 -M 3 --resume --checkpoint none.cbor", "none.cbor");
  expect_refused("exact set.h5 -M 3 -o no/such/folder.json", "no/such");
  graybox("problem random --family r1g --candidates 30 --dimension 4 -o lines.h5");
  expect_refused("exact lines.h5 -M 3", "take at least 4");
}

}  // namespace
}  // namespace graybox
