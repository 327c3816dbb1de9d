#include "problems/robot_information/robot_grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <set>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

std::filesystem::path write_file(const std::string& text) {
  const std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("graybox_positions_") +
       ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv");
  std::ofstream(file) << text;
  return file;
}

std::vector<double> row(const PositionTable& table, std::size_t i) {
  const auto position = table.position(i);
  return {position.begin(), position.end()};
}

TEST(RobotGrid, PaperGridHoldsAllCombinationsInOrder) {
  const PositionTable grid = paper_grid();
  ASSERT_EQ(grid.count(), 7920U);
  ASSERT_EQ(grid.joint_count, 6U);
  std::size_t i = 0;
  for (int q1 = 0; q1 <= 90; q1 += 45) {
    for (int q2 = -60; q2 <= 90; q2 += 15) {
      for (int q3 = -165; q3 <= 60; q3 += 15) {
        for (int q4 = 0; q4 <= 90; q4 += 45) {
          for (int q5 = -90; q5 <= 90; q5 += 45) {
            const std::vector<double> expected = {double(q1), double(q2), double(q3),
                                                  double(q4), double(q5), 0.0};
            ASSERT_EQ(row(grid, i++), expected);
          }
        }
      }
    }
  }
}

TEST(RobotGrid, AnyCountIsMetExactlyWithoutRepeats) {
  for (const std::size_t count : {1UL, 50UL, 7919UL, 7920UL, 7921UL, 100000UL}) {
    const PositionTable grid = robot_grid(count);
    ASSERT_EQ(grid.count(), count);
    std::set<std::vector<double>> rows;
    for (std::size_t i = 0; i < count; ++i) rows.insert(row(grid, i));
    EXPECT_EQ(rows.size(), count);
    EXPECT_GE(*std::ranges::min_element(grid.degrees), -165.0);
    EXPECT_LE(*std::ranges::max_element(grid.degrees), 90.0);
  }
  EXPECT_EQ(robot_grid(7920).degrees, paper_grid().degrees);
  EXPECT_THROW((void)robot_grid(0), InputError);
}

TEST(RobotGrid, SmallSetsAreNested) {
  const PositionTable small = robot_grid(50), large = robot_grid(500);
  EXPECT_TRUE(std::equal(small.degrees.begin(), small.degrees.end(), large.degrees.begin()));
}

TEST(RobotGrid, ReadsPositionsFromCsv) {
  const auto file = write_file("q1, q2\n# a comment\n\n1, -2.5\r\n 3e1 ,4\n");
  const PositionTable table = read_positions(file, 2);
  ASSERT_EQ(table.count(), 2U);
  EXPECT_EQ(table.degrees, (std::vector<double>{1.0, -2.5, 30.0, 4.0}));
}

TEST(RobotGrid, BadCsvIsNamedInOneLine) {
  const auto message = [](const std::string& text) -> std::string {
    try {
      (void)read_positions(write_file(text), 2);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_NE(message("1,2\n3\n").find(":2: a position has 2 angles"), std::string::npos);
  EXPECT_NE(message("1,2\n3,x\n").find(":2: 'x' is not a finite number"), std::string::npos);
  EXPECT_NE(message("1,nan\n").find(":1: 'nan' is not a finite number"), std::string::npos);
  EXPECT_NE(message("q1,q2\nq1,q2\n").find(":2: 'q1'"), std::string::npos);
  EXPECT_NE(message("# nothing\n").find("holds no position"), std::string::npos);
  EXPECT_THROW((void)read_positions("/nowhere/positions.csv", 2), InputError);
}

TEST(RobotGrid, SubsetsAreChecked) {
  const std::vector<std::size_t> good = {3, 1}, bad = {7920};
  const PositionTable grid = paper_grid();
  EXPECT_EQ(row(grid.subset(good), 0), row(grid, 3));
  EXPECT_THROW((void)grid.subset(bad), InputError);
}

}  // namespace
}  // namespace graybox
