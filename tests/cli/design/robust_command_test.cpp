// `graybox design robust` and `graybox design efficiency` as users see them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "problems/families/families.hpp"
#include "problems/formats/information_set_file.hpp"
#include "solvers/report/design_file.hpp"
#include "solvers/robust/concentration_limit.hpp"
#include "solvers/robust/robust_problem.hpp"
#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::write_text;
using Json = nlohmann::json;

class RobustCommand : public testing::CommandRunner {
 protected:
  void make(const std::string& name, std::size_t candidates, std::size_t dimension,
            std::uint64_t seed) {
    write_information_set(folder_.file(name), make_family("wis", candidates, dimension, seed));
  }
};

TEST_F(RobustCommand, SetsOfOneGridGiveACertifiedDesign) {
  for (std::uint64_t s = 1; s <= 3; ++s) make("set" + std::to_string(s) + ".h5", 100, 3, s);
  std::vector<InformationSet> sets;
  RobustProblem problem;
  for (int s = 1; s <= 3; ++s) {
    sets.push_back(read_information_set(folder_.file("set" + std::to_string(s) + ".h5")));
  }
  for (const InformationSet& set : sets) problem.samples.push_back(&set);
  for (const std::string objective : {"average", "worst_case"}) {
    const Outcome outcome = graybox("design robust set1.h5 set2.h5 set3.h5 --objective " +
                                    objective + " --gap 1e-8 --json -o design.json");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    EXPECT_EQ(std::ranges::count(outcome.out, '\n'), 1);
    const Json report = Json::parse(outcome.out);
    EXPECT_EQ(report["status"], "solved");
    EXPECT_EQ(report["objective"]["name"], objective);

    // The file's design, by our own checker, with the file's multipliers.
    const Json file = Json::parse(read_text(folder_.file("design.json")));
    problem.objective = robust_objective(objective);
    problem.references.clear();
    std::vector<double> prices;
    for (const Json& sample : file["objective"]["samples"]) {
      prices.push_back(sample["price"]);
      if (objective == "worst_case") problem.references.push_back(sample["optimum"]);
      EXPECT_GT(sample["efficiency"].get<double>(), 0.0);
      EXPECT_LE(sample["efficiency"].get<double>(), 1.0 + 1e-9);
    }
    const DesignFile design = read_design(folder_.file("design.json"), sets[0]);
    EXPECT_EQ(design.objective, objective);
    const Certificate proof = certify_robust(problem, design.design, prices).certificate;
    EXPECT_NEAR(proof.duality_gap, report["duality_gap"].get<double>(), 1e-12);
    EXPECT_LE(proof.duality_gap, 1.01e-8);
  }
  // `check` holds the design against one set, and says what it was made for.
  const Json checked = Json::parse(graybox("check set1.h5 design.json --json").out);
  EXPECT_EQ(checked["status"], "inaccurate");
  EXPECT_EQ(checked["message"], "made for the objective worst_case");
}

TEST_F(RobustCommand, ConcentrationLimitIsObeyedAndPrinted) {
  make("set.h5", 200, 4, 5);
  const Outcome outcome = graybox(
      "design robust set.h5 --largest-share 0.4 --of-positions 0.02 --gap 1e-8 --json -o d.json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json report = Json::parse(outcome.out);
  EXPECT_EQ(report["status"], "solved");
  EXPECT_EQ(report["objective"]["positions"], 4);
  const InformationSet set = read_information_set(folder_.file("set.h5"));
  const DesignFile design = read_design(folder_.file("d.json"), set);
  const auto proof = certify_concentrated(set, design.design, {0.4, 4});
  EXPECT_EQ(proof.certificate.duality_gap, report["duality_gap"].get<double>());
  EXPECT_LE(proof.concentration, 0.4 + 1e-9);
  EXPECT_NE(graybox("design robust set.h5 --largest-share 0.4 --of-positions 0.02")
                .out.find("at most 0.4 of the weight on any 4 positions"),
            std::string::npos);

  // `check` holds the file to its limit, not to the optimum without it.
  const Outcome checked = graybox("check set.h5 d.json --json");
  EXPECT_EQ(checked.exit_code, 0) << checked.out;
  EXPECT_EQ(Json::parse(checked.out)["duality_gap"], report["duality_gap"]);
  Json file = Json::parse(read_text(folder_.file("d.json")));
  const std::string stated = file.dump();
  file.erase("limits");
  write_text(folder_.file("free.json"), file.dump());
  EXPECT_EQ(graybox("check set.h5 free.json").exit_code, 1);
  file = Json::parse(stated);
  file["limits"]["concentration"]["largest_share"] = 0.3;
  write_text(folder_.file("broken.json"), file.dump());
  EXPECT_NE(graybox("check set.h5 broken.json").out.find("the limit is 0.3"), std::string::npos);
  file["limits"]["concentration"]["positions"] = 300;
  write_text(folder_.file("bad.json"), file.dump());
  expect_refused("check set.h5 bad.json", "limits.concentration.positions");
}

TEST_F(RobustCommand, SamplesOfTheRobot) {
  const std::string samples = "--grid 60 --samples 4 --uncertainty 0.2 --seed 7 ";
  const Outcome outcome = graybox("design robust " + samples + "--json -o design.json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json report = Json::parse(outcome.out);
  ASSERT_EQ(report["objective"]["samples"].size(), 4U);
  for (const Json& sample : report["objective"]["samples"]) {
    for (const double theta : sample["theta"]) EXPECT_LE(std::abs(theta - 1.0), 0.2);
    EXPECT_GE(sample["efficiency"].get<double>(),
              std::exp(report["log_det"].get<double>() / 12.0) - 1e-9);
  }
  const Json again = Json::parse(graybox("design robust " + samples + "--threads 2 --json").out);
  EXPECT_EQ(again["log_det"], report["log_det"]);

  const Outcome table = graybox(
      "design efficiency design.json --best-single --grid 60 --samples 5 --uncertainty 0.2 "
      "--json -o table.csv");
  ASSERT_EQ(table.exit_code, 0) << table.err;
  const Json summary = Json::parse(table.out);
  EXPECT_EQ(summary["samples"], 5);
  ASSERT_EQ(summary["designs"].size(), 2U);
  EXPECT_EQ(summary["designs"][1]["design"], "design");
  EXPECT_GT(summary["designs"][1]["smallest"].get<double>(),
            summary["designs"][0]["median"].get<double>());
}

TEST_F(RobustCommand, EfficiencyGoesOnWhereItStopped) {
  ASSERT_EQ(graybox("design robust --grid 40 --samples 2 -o design.json").exit_code, 0);
  const std::string run = "design efficiency design.json --grid 40 -o table.csv --samples ";
  ASSERT_EQ(graybox(run + "6").exit_code, 0);
  const std::string whole = read_text(folder_.file("table.csv"));
  ASSERT_EQ(graybox(run + "3 --fresh").exit_code, 0);
  EXPECT_EQ(whole.find(read_text(folder_.file("table.csv"))), 0U);
  ASSERT_EQ(graybox(run + "6").exit_code, 0);
  EXPECT_EQ(read_text(folder_.file("table.csv")), whole);
  expect_refused(run + "6 --seed 9", "of other samples");
  expect_refused(run + "6 --best-single", "with other columns");
  ASSERT_EQ(graybox("design robust --grid 40 --samples 3 -o design.json").exit_code, 0);
  expect_refused(run + "6", "of other designs");
}

TEST_F(RobustCommand, RefusesBadInputInOneLine) {
  make("a.h5", 50, 3, 1);
  make("b.h5", 60, 3, 2);
  make("c.h5", 50, 2, 3);
  const std::string robust = "design robust ";
  expect_refused(robust + "a.h5 b.h5", "b.h5 has 60 candidates");
  expect_refused(robust + "a.h5 c.h5", "c.h5 has 50 candidates and 2 parameters");
  expect_refused(robust + "missing.h5", "missing.h5");
  expect_refused(robust + "--samples 0", "at least one sample");
  expect_refused(robust + "--uncertainty 1", "uncertainty 1 must be");
  expect_refused(robust + "a.h5 --samples 3", "--samples is for samples of a robot");
  expect_refused(robust + "a.h5 --objective median", "choose average or worst_case");
  expect_refused(robust + "a.h5 --reference some", "choose optimum or none");
  expect_refused(robust + "a.h5 --gap 0", "--gap: 0 must be a positive number");
  expect_refused(robust + "a.h5 --largest-share 0.5", "go together");
  expect_refused(robust + "a.h5 --of-positions 0.5", "go together");
  expect_refused(robust + "a.h5 --largest-share 0.1 --of-positions 0.2", "no design puts");
  expect_refused(robust + "a.h5 --largest-share 0 --of-positions 0.2", "largest share 0 must be");
  expect_refused(robust + "a.h5 --largest-share 0.5 --of-positions 2", "positions 2 must be");
  expect_refused(robust + "a.h5 --largest-share 0.5 --of-positions 0.01", "less than one");
  expect_refused(robust + "a.h5 b.h5 --largest-share 0.5 --of-positions 0.1",
                 "takes one information set");
  expect_refused(robust + "a.h5 --objective average --largest-share 0.5 --of-positions 0.1",
                 "does not go with the concentration limit");
  expect_refused(robust + "a.h5 -o missing/design.json", "missing");
  expect_refused("design efficiency --grid 40", "no design given");
  expect_refused("design efficiency missing.json --grid 40", "missing.json");
  write_text(folder_.file("design.json"), "{\"format\": \"graybox-design/1\"}");
  expect_refused("design efficiency design.json --grid 40", "support is missing");
}

}  // namespace
}  // namespace graybox
