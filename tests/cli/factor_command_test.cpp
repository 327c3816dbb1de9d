// Sets in factor form through the command: read, solved, checked, converted, refused.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

class FactorCommand : public testing::CommandRunner {
 protected:
  nlohmann::json json_of(const std::string& arguments) {
    const testing::Outcome outcome = graybox(arguments + " --json");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out);
  }
  void expect_exit_two(const std::string& arguments, const std::string& text) {
    const testing::Outcome outcome = graybox(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    EXPECT_NE(outcome.err.find(text), std::string::npos) << outcome.err;
  }
};

TEST_F(FactorCommand, ADesignOfTheFactorsIsOneOfTheMatrices) {
  const std::string random = "problem random --family r1g --candidates 2000 --dimension 5 ";
  const testing::Outcome made = graybox(random + "--factors -o factors.h5");
  EXPECT_EQ(made.exit_code, 0) << made.err;
  EXPECT_NE(made.out.find("as factors of rank 1"), std::string::npos) << made.out;
  EXPECT_EQ(graybox(random + "-o matrices.h5").exit_code, 0);
  const auto first = json_of("solve factors.h5 --gap 1e-9 -o design.json");
  const auto second = json_of("solve matrices.h5 --gap 1e-9");
  EXPECT_EQ(first["problem_hash"], second["problem_hash"]);
  EXPECT_NEAR(first["log_det"].get<double>(), second["log_det"].get<double>(), 1e-8);
  for (const char* set : {"factors.h5", "matrices.h5"}) {
    const auto checked = json_of(std::string("check ") + set + " design.json --gap 1e-9");
    EXPECT_EQ(checked["status"], "solved") << set;
  }
  EXPECT_EQ(graybox("problem convert factors.h5 -o again.h5").exit_code, 0);
  EXPECT_EQ(graybox("problem convert factors.h5 -o matrices.npy").exit_code, 0);
  EXPECT_EQ(testing::read_text(folder_.file("again.h5")),
            testing::read_text(folder_.file("factors.h5")));
  EXPECT_EQ(json_of("solve matrices.npy")["problem_hash"], first["problem_hash"]);
  EXPECT_EQ(json_of("solve factors.h5 --criterion A")["status"], "solved");
  EXPECT_EQ(json_of("solve factors.h5 --solver dual_interior_point")["status"], "solved");
  EXPECT_EQ(graybox("exact factors.h5 --experiments 8").exit_code, 0);
}

TEST_F(FactorCommand, VectorsAndJacobians) {
  std::string lines = "constant,slope\n";
  for (int k = 0; k <= 20; ++k) lines += "1," + std::to_string(k - 10) + "\n";
  testing::write_text(folder_.file("lines.csv"), lines);
  // A straight line: half of the weight at each end.
  const auto found = json_of("solve lines.csv --factors --gap 1e-9 -o design.json");
  EXPECT_NEAR(found["log_det"].get<double>(), std::log(100.0), 1e-8);
  EXPECT_EQ(graybox("problem from-jacobians lines.csv --noise 0.1 --factors -o set.h5").exit_code,
            0);
  EXPECT_EQ(graybox("problem from-jacobians lines.csv --noise 0.1 -o matrices.h5").exit_code, 0);
  EXPECT_NEAR(json_of("solve set.h5 --gap 1e-9")["log_det"].get<double>(),
              json_of("solve matrices.h5 --gap 1e-9")["log_det"].get<double>(), 1e-8);
  expect_exit_two("problem from-jacobians lines.csv --factors -o set.npy", "--factors writes .h5");
  expect_exit_two("solve set.h5 --factors", "leave it out");
  expect_exit_two("problem random --family wis --factors -o wis.h5", "r1g and r1l");
  expect_exit_two("solve lines.csv --factors --solver none", "none");
}

}  // namespace
}  // namespace graybox
