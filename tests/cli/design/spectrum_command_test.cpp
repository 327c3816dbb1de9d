// `graybox problem spectrum` and `graybox design spectrum` as users see them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/formats/information_set_file.hpp"
#include "problems/robot_information/robot_spectrum_information.hpp"
#include "solvers/blocks/block_limited_certificate.hpp"
#include "solvers/report/design_file.hpp"
#include "tests/support/command_runner.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::write_text;
using Json = nlohmann::json;

class SpectrumCommand : public testing::CommandRunner {
 protected:
  // The rows of a CSV file by column.
  std::vector<std::map<std::string, std::string>> rows(const std::string& file) {
    std::istringstream stream(read_text(folder_.file(file)));
    const auto cells = [](const std::string& line) {
      std::vector<std::string> result;
      std::istringstream cell_stream(line);
      for (std::string cell; std::getline(cell_stream, cell, ',');) result.push_back(cell);
      return result;
    };
    std::string line;
    std::getline(stream, line);
    const std::vector<std::string> names = cells(line);
    std::vector<std::map<std::string, std::string>> all;
    while (std::getline(stream, line)) {
      const std::vector<std::string> values = cells(line);
      EXPECT_EQ(values.size(), names.size()) << line;
      all.emplace_back();
      for (std::size_t k = 0; k < names.size(); ++k) all.back()[names[k]] = values[k];
    }
    return all;
  }
};

TEST_F(SpectrumCommand, TheDesignIsTheSetsAndChecked) {
  ASSERT_EQ(graybox("problem spectrum --grid 8 -o set.h5").exit_code, 0);
  const Outcome designed = graybox("design spectrum --grid 8 --gap 1e-8 --json -o design.json");
  ASSERT_EQ(designed.exit_code, 0) << designed.err;
  EXPECT_EQ(designed.err, "");
  EXPECT_EQ(std::ranges::count(designed.out, '\n'), 1);
  const Json report = Json::parse(designed.out);
  const InformationSet set = read_information_set(folder_.file("set.h5"));
  const RobotModel robot = robot_test::paper_robot();
  EXPECT_EQ(set.content_hash(), robot_spectrum_set(robot, robot_grid(8)).content_hash());
  EXPECT_EQ(report["problem_hash"], set.content_hash());

  const DesignFile file = read_design(folder_.file("design.json"), set);
  const Certificate certificate = certify(set, file.design);
  EXPECT_LE(certificate.duality_gap, 1.1e-8);
  EXPECT_EQ(report["duality_gap"].get<double>(), certificate.duality_gap);
  EXPECT_NEAR(report["covariance"].get<double>(), std::exp(-certificate.log_det / 12.0), 1e-9);
  const Json written = Json::parse(read_text(folder_.file("design.json")));
  for (const char* name : {"q1", "q6", "frequency", "axis"}) {
    EXPECT_TRUE(written["support"][0]["candidate"].contains(name)) << name;
  }
  EXPECT_EQ(graybox("check set.h5 design.json").exit_code, 0);
}

// The limit is in the file: `check` holds the design to it, and compares with the best under it.
TEST_F(SpectrumCommand, CheckHoldsADesignToItsPositionLimit) {
  ASSERT_EQ(graybox("problem spectrum --grid 8 -o set.h5").exit_code, 0);
  const Outcome designed =
      graybox("design spectrum --grid 8 --gap 1e-6 --position-limit 0.2 --json -o design.json");
  ASSERT_EQ(designed.exit_code, 0) << designed.err;
  const Outcome checked = graybox("check set.h5 design.json --json");
  EXPECT_EQ(checked.exit_code, 0) << checked.out;
  const Json report = Json::parse(checked.out);
  EXPECT_EQ(report["duality_gap"], Json::parse(designed.out)["duality_gap"]);
  EXPECT_EQ(report["limits"]["block_share"]["largest_share"], 0.2);

  Json file = Json::parse(read_text(folder_.file("design.json")));
  const Json limits = file["limits"];
  file.erase("limits");  // far from the best without limits
  write_text(folder_.file("free.json"), file.dump());
  EXPECT_EQ(graybox("check set.h5 free.json").exit_code, 1);
  file["limits"] = limits;
  file["limits"]["block_share"]["largest_share"] = 0.15;
  write_text(folder_.file("broken.json"), file.dump());
  const Outcome broken = graybox("check set.h5 broken.json --json");
  EXPECT_EQ(broken.exit_code, 1);
  EXPECT_EQ(Json::parse(broken.out)["status"], "claimed_but_wrong");
  EXPECT_NE(broken.out.find("more than the limit"), std::string::npos) << broken.out;
  const auto refused = [&](const Json& bad) {
    file["limits"] = bad;
    write_text(folder_.file("bad.json"), file.dump());
    const Outcome outcome = graybox("check set.h5 bad.json");
    EXPECT_EQ(outcome.exit_code, 2) << bad.dump();
    EXPECT_NE(outcome.err.find("bad.json"), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
  };
  refused({{"block_share", {{"largest_share", 0.2}, {"block_size", 7}}}});
  refused({{"block_share",
            {{"largest_share", 0.01}, {"block_size", limits["block_share"]["block_size"]}}}});
  refused({{"block_share", {{"largest_share", "much"}, {"block_size", 1}}}});
  refused({{"block_share", {{"largest_share", 0.2}, {"block_size", -1}}}});
  refused({{"block_share", 0.2}});
  refused({{"axis_share", {{"largest_share", 0.2}}}});
}

TEST_F(SpectrumCommand, SpectraHoldTheirPowerAndTheSharesTheirSum) {
  ASSERT_EQ(
      graybox("design spectrum --grid 12 --compare --spectra s.csv --comparison c.csv").exit_code,
      0);
  const double power = flat_power(robot_test::paper_robot());
  std::map<std::string, std::map<std::string, double>> power_sum, share;
  for (const auto& row : rows("s.csv")) {
    const std::string& design = row.at("design");
    EXPECT_NE(design, "flat");
    power_sum[design][row.at("position")] += std::stod(row.at("power"));
    share[design][row.at("position")] = std::stod(row.at("share"));
    EXPECT_NEAR(std::stod(row.at("weight")),
                std::stod(row.at("share")) * std::stod(row.at("power")) / power, 1e-7);
  }
  EXPECT_EQ(power_sum.size(), 3U);
  for (const auto& [design, positions] : power_sum) {
    double total = 0.0;
    for (const auto& [position, sum] : positions) {
      EXPECT_NEAR(sum, power, 1e-5 * power) << design;
      total += share[design][position];
    }
    EXPECT_NEAR(total, 1.0, 1e-6) << design;
  }
}

TEST_F(SpectrumCommand, ComparesDesignsInTheRightOrder) {
  const Outcome outcome =
      graybox("design spectrum --grid 12 --position-limit 1,0.2,0.1 --comparison c.csv --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::map<std::string, double> covariance;
  for (const auto& row : rows("c.csv")) {
    covariance[row.at("design") + row.at("position_limit")] = std::stod(row.at("covariance"));
    EXPECT_LE(std::stod(row.at("own_gap")), 1.1e-6);
    EXPECT_EQ(row.at("status"), "solved");
  }
  ASSERT_EQ(covariance.size(), 6U);
  EXPECT_LE(covariance["joint1"], covariance["joint0.2"] * (1 + 1e-5));
  EXPECT_LE(covariance["joint0.2"], covariance["joint0.1"] * (1 + 1e-5));
  EXPECT_LE(covariance["joint1"], covariance["two_step1"] * (1 + 1e-5));
  EXPECT_LE(covariance["joint1"], covariance["blocks_first1"] * (1 + 1e-5));
  EXPECT_LE(covariance["blocks_first1"], covariance["flat1"] * (1 + 1e-5));
  EXPECT_EQ(Json::parse(outcome.out)["comparison"].size(), 6U);
}

TEST_F(SpectrumCommand, ThePositionLimitIsCertified) {
  const Outcome outcome =
      graybox("design spectrum --grid 20 --position-limit 0.08 --json -o design.json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json report = Json::parse(outcome.out);
  EXPECT_EQ(report["position_limit"], 0.08);
  const RobotModel robot = robot_test::paper_robot();
  const InformationSet set = robot_spectrum_set(robot, robot_grid(20));
  const CandidateBlocks blocks = equal_blocks(set.candidate_count(), line_count(robot));
  const DesignFile file = read_design(folder_.file("design.json"), set);
  const Certificate certificate = certify_block_limited(set, file.design, blocks, 0.08);
  EXPECT_EQ(certificate.status, CertificateStatus::kCertified) << certificate.message;
  EXPECT_LE(certificate.duality_gap, 1.1e-6);
  EXPECT_EQ(report["duality_gap"].get<double>(), certificate.duality_gap);
}

// Without deviation the robot is itself; with it, designs lose.
TEST_F(SpectrumCommand, RobustnessStartsAtTheDesignsOwnCovariance) {
  const Outcome outcome = graybox("design spectrum --grid 5 --robustness r.csv --samples 3 --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto table = rows("r.csv");
  ASSERT_EQ(table.size(), 6U);
  const double own = Json::parse(outcome.out)["covariance"].get<double>();
  EXPECT_NEAR(std::stod(table[0].at("covariance_worst")), own, 1e-4 * own);
  for (const auto& row : table) {
    EXPECT_LE(std::stod(row.at("covariance_median")), std::stod(row.at("covariance_worst")));
  }
}

TEST_F(SpectrumCommand, AnswersDoNotDependOnThreads) {
  for (const char* threads : {"1", "2"}) {
    ASSERT_EQ(graybox(std::string("design spectrum --grid 7 --spectra s") + threads +
                      ".csv --threads " + threads)
                  .exit_code,
              0);
  }
  EXPECT_EQ(read_text(folder_.file("s1.csv")), read_text(folder_.file("s2.csv")));
}

TEST_F(SpectrumCommand, TakesOtherRobotsAndPositions) {
  write_text(folder_.file("positions.csv"), "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n45,15,-150,0,-90,0\n");
  const std::string model = (robot_test::robot_folder() / "irb6600_like.yaml").string();
  EXPECT_EQ(graybox("design spectrum --model '" + model + "' --grid positions.csv").exit_code, 0);
}

TEST_F(SpectrumCommand, RefusesBadInputInOneLine) {
  expect_refused("design spectrum --grid 10 --position-limit 0.05", "must exceed 1/10");
  expect_refused("design spectrum --grid 10 --position-limit 0", "must be positive");
  expect_refused("design spectrum --grid 10 --position-limit 0.5,x", "position-limit");
  expect_refused("design spectrum --grid 10 --gap 0", "--gap: 0 must be a positive number");
  expect_refused("design spectrum --grid 0", "--grid 0: ");
  expect_refused("design spectrum --grid missing.csv", "missing.csv: no such file");
  expect_refused("design spectrum --model missing.yaml", "missing.yaml");
  expect_refused("design spectrum --grid 5 -o nowhere/design.json", "nowhere");
  expect_refused("design spectrum --grid 5 --threads 0", "--threads");
  expect_refused("design spectrum --grid 5 --samples 0", "--samples");
  expect_refused("problem spectrum --grid 5", "--output");
  expect_refused("problem spectrum --grid 5 -o set.xyz", "set.xyz");
}

TEST(AvailableMemory, IsForeseen) {
  EXPECT_GT(available_memory(), 0U);
  EXPECT_NO_THROW(require_memory(1, "one byte", "impossible"));
  try {
    require_memory(std::size_t{1} << 60, "the set", "choose a smaller --grid");
    ADD_FAILURE() << "an exabyte is available";
  } catch (const InputError& error) {
    const std::string line = error.what();
    EXPECT_NE(line.find("the set takes"), std::string::npos) << line;
    EXPECT_NE(line.find("smaller --grid"), std::string::npos) << line;
  }
}

}  // namespace
}  // namespace graybox
