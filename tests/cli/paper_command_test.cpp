// `graybox paper`: files written, one clear line for wrong input.
#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::read_text;
using testing::write_text;

class PaperCommand : public testing::CommandRunner {
 protected:
  void SetUp() override {
    ASSERT_EQ(graybox("problem robot --grid 60 -o set.h5").exit_code, 0);
    ASSERT_EQ(graybox("solve set.h5 -o design.json").exit_code, 0);
  }
};

TEST_F(PaperCommand, WritesItsTables) {
  ASSERT_EQ(graybox("paper table_1 set.h5 design.json -o table_1.csv").exit_code, 0);
  EXPECT_EQ(read_text(folder_.file("table_1.csv"))
                .find("row,candidate,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,covariance,weight"),
            0U);
  ASSERT_EQ(graybox("paper figure_2 --count 5 -o figure_2.csv").exit_code, 0);
  const std::string response = read_text(folder_.file("figure_2.csv"));
  EXPECT_EQ(std::ranges::count(response, '\n'), 6);
  ASSERT_EQ(graybox("paper figure_4 set.h5 design.json --experiments 3 --repetitions 20 "
                    "-o figure_4.csv")
                .exit_code,
            0);
  EXPECT_EQ(std::ranges::count(read_text(folder_.file("figure_4.csv")), '\n'), 4);
  ASSERT_EQ(graybox("paper figure_5 set.h5 design.json -o figure_5.csv").exit_code, 0);
  EXPECT_NE(read_text(folder_.file("figure_5.csv")).find(",payload,"), std::string::npos);
}

TEST_F(PaperCommand, RefusesWrongInput) {
  expect_refused("paper", "required");
  expect_refused("paper figure_7", "choose one of");
  expect_refused("paper table_1 missing.h5 design.json -o t.csv", "missing.h5");
  expect_refused("paper table_1 set.h5 missing.json -o t.csv", "missing.json");
  expect_refused("paper table_1 set.h5 design.json -o nowhere/t.csv", "nowhere");
  expect_refused("paper figure_2 --position 0,0 -o f.csv", "joint");
  expect_refused("paper figure_2 --from 10 --to 5 -o f.csv", "--from");
  expect_refused("paper figure_2 --to 2000 -o f.csv", "sample rate");
  expect_refused("paper figure_2 --model missing.yaml -o f.csv", "missing.yaml");
  expect_refused("paper figure_4 set.h5 design.json --experiments 0 -o f.csv", "at least 1");
  expect_refused("paper figure_4 set.h5 design.json --repetitions 0 -o f.csv", "at least 1");
  ASSERT_EQ(
      graybox("problem random --family wis --candidates 60 --dimension 12 -o other.h5").exit_code,
      0);
  expect_refused("paper table_1 other.h5 design.json -o t.csv", "design.json");
  ASSERT_EQ(graybox("solve other.h5 -o other.json").exit_code, 0);
  expect_refused("paper figure_5 other.h5 other.json -o f.csv", "other.h5");
}

}  // namespace
}  // namespace graybox
