// `graybox problem from-jacobians`: designs that textbooks know, and what is refused.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

struct SupportPoint {
  double x;
  double weight;
};

class JacobianCommand : public testing::CommandRunner {
 protected:
  // A grid of `count` points x from `low` to `high`, its Jacobians and coordinates.
  void write_grid(double low, double high, int count, const std::string& header,
                  const std::function<std::string(double)>& row) {
    std::string jacobians = header + "\n", places = "x\n";
    for (int k = 0; k < count; ++k) {
      const double x = low + (high - low) * k / (count - 1);
      jacobians += row(x) + "\n";
      places += fmt::format("{:.17g}\n", x);
    }
    testing::write_text(folder_.file("jacobians.csv"), jacobians);
    testing::write_text(folder_.file("places.csv"), places);
  }

  // Support points of the D-optimal design; neighbours on the grid count as one.
  std::vector<SupportPoint> support(const std::string& options) {
    const testing::Outcome made = graybox(
        "problem from-jacobians jacobians.csv --candidates places.csv -o set.h5 " + options);
    EXPECT_EQ(made.exit_code, 0) << made.err;
    EXPECT_EQ(graybox("solve set.h5 --gap 1e-9 -o design.json").exit_code, 0);
    const auto design = nlohmann::json::parse(testing::read_text(folder_.file("design.json")));
    std::vector<SupportPoint> points;
    double last = -1e300;
    for (const auto& entry : design["support"]) {
      const double x = entry["candidate"]["x"], weight = entry["weight"];
      if (weight < 1e-6) continue;
      if (!points.empty() && x - last < 0.05) {
        SupportPoint& point = points.back();
        point.x = (point.x * point.weight + x * weight) / (point.weight + weight);
        point.weight += weight;
      } else {
        points.push_back({x, weight});
      }
      last = x;
    }
    return points;
  }

  static void expect_points(const std::vector<SupportPoint>& found,
                            const std::vector<SupportPoint>& expected) {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t k = 0; k < found.size(); ++k) {
      EXPECT_NEAR(found[k].x, expected[k].x, 2e-3);
      EXPECT_NEAR(found[k].weight, expected[k].weight, 2e-3);
    }
  }
};

std::string straight_line(double x) { return fmt::format("1,{:.17g}", x); }

// eta = +-1.5434 (Abdelbasit and Plackett 1983), here with eta = -1 + 2 x.
TEST_F(JacobianCommand, LogisticRegressionHasTheTextbooksDesign) {
  write_grid(-2.0, 3.0, 5001, "a,b", straight_line);
  expect_points(support("--model logistic --at a=-1,b=2"),
                {{0.5 - 0.5 * 1.5434, 0.5}, {0.5 + 0.5 * 1.5434, 0.5}});
}

// A straight line in two days of two runs: one at each end on each day, whose slope has S = 4. The
// design is checked again from its file, and a generalised linear model has one offset a day.
TEST_F(JacobianCommand, DaysHaveOffsetsOfTheirOwn) {
  testing::write_text(folder_.file("line.csv"), "slope\n-1\n0\n1\n");
  ASSERT_EQ(graybox("problem from-jacobians line.csv --blocks 2 -o days.h5").exit_code, 0);
  const std::string asked = "--criterion Ds --interest '!block_*' --block-sizes 2,2 ";
  for (const char* command : {"solve", "exact"}) {
    SCOPED_TRACE(command);
    const testing::Outcome found =
        graybox(fmt::format("{} days.h5 {} -o design.json", command, asked));
    ASSERT_EQ(found.exit_code, 0) << found.err;
    EXPECT_EQ(graybox("check days.h5 design.json").exit_code, 0);
    const auto design = nlohmann::json::parse(testing::read_text(folder_.file("design.json")));
    EXPECT_EQ(design["request"]["block_sizes"], "2,2");
    double runs = 0.0;
    for (const auto& entry : design["support"]) {
      const double x = entry["candidate"]["experiment"];
      if (x != 1.0) runs += 4.0 * entry["weight"].get<double>();
    }
    EXPECT_NEAR(runs, 4.0, 1e-6);
  }
  ASSERT_EQ(graybox("problem from-jacobians line.csv --outputs 3 --model logistic --at slope=1 "
                    "--blocks 2 -o one.h5")
                .exit_code,
            0);
  const testing::Outcome one = graybox("solve one.h5 --criterion Ds --interest nothing");
  EXPECT_NE(one.err.find("slope, block_1.offset, block_2.offset"), std::string::npos) << one.err;
}

TEST_F(JacobianCommand, WrongBlocksAreOneLine) {
  testing::write_text(folder_.file("line.csv"), "one,slope\n1,-1\n1,0\n1,1\n");
  testing::write_text(folder_.file("short.csv"), "drift\n1\n");
  const auto refused = [&](const std::string& command, const std::string& text) {
    const testing::Outcome outcome = graybox(command);
    EXPECT_EQ(outcome.exit_code, 2) << command;
    EXPECT_NE(outcome.err.find(text), std::string::npos) << outcome.err;
  };
  const std::string make = "problem from-jacobians line.csv -o set.h5 ";
  refused(make + "--blocks 2", "column 'one' can't be told from the effects of the blocks");
  refused(make + "--block-effects short.csv", "--block-effects goes with --blocks");
  refused(make + "--blocks 2 --block-effects short.csv", "1 rows, but line.csv has 3");
  ASSERT_EQ(graybox(make).exit_code, 0);
  refused("solve set.h5 --block-sizes 2,2", "has no coordinate 'block'");
  refused("solve set.h5 --block-sizes 2,b", "'b' is no size");
  refused("solve set.h5 --criterion Ds --interest 'b*'", "no parameter fits 'b*'");
  refused("solve set.h5 --criterion Ds --interest '!*'", "leaves no parameter");
}

// eta = its upper bound and 2 less (Ford, Torsney and Wu 1992).
TEST_F(JacobianCommand, PoissonRegressionHasTheTextbooksDesign) {
  write_grid(-6.0, 0.0, 6001, "a,b", straight_line);
  expect_points(support("--model poisson --at a=0,b=1"), {{-2.0, 0.5}, {0.0, 0.5}});
  testing::write_text(folder_.file("theta.csv"), "b,a\n1,0\n");  // by names
  expect_points(support("--model poisson --at theta.csv"), {{-2.0, 0.5}, {0.0, 0.5}});
  expect_points(support("--model poisson --at 0,1"), {{-2.0, 0.5}, {0.0, 0.5}});
}

TEST_F(JacobianCommand, QuadraticRegressionHasThreeEqualPoints) {
  write_grid(-1.0, 1.0, 2001, "a,b,c",
             [](double x) { return fmt::format("1,{:.17g},{:.17g}", x, x * x); });
  expect_points(support("--noise 0.3"), {{-1.0, 1.0 / 3}, {0.0, 1.0 / 3}, {1.0, 1.0 / 3}});
}

// y = V x / (K + x) on (0, b]: b and K b / (2 K + b) (Duggleby 1979); K = 1, b = 4: 2/3.
TEST_F(JacobianCommand, MichaelisMentenHasTheTextbooksDesign) {
  write_grid(0.004, 4.0, 4001, "V,K", [](double x) {
    return fmt::format("{:.17g},{:.17g}", x / (1 + x), -3 * x / ((1 + x) * (1 + x)));
  });
  expect_points(support("--noise 0.1"), {{2.0 / 3.0, 0.5}, {4.0, 0.5}});
}

TEST_F(JacobianCommand, OutputsOfACandidateAddUp) {
  testing::write_text(folder_.file("two.csv"), "candidate,a,b\n7,1,2\n7,3,4\n9,1,0\n9,0,1\n");
  testing::write_text(folder_.file("covariance.csv"), "2,1\n1,2\n");
  ASSERT_EQ(graybox("problem from-jacobians two.csv --noise covariance.csv -o set.csv").exit_code,
            0);
  testing::write_text(folder_.file("plain.csv"), "1,2\n3,4\n1,0\n0,1\n");
  ASSERT_EQ(graybox("problem from-jacobians plain.csv --outputs 2 --noise covariance.csv -o b.csv")
                .exit_code,
            0);
  const std::string set = testing::read_text(folder_.file("set.csv"));
  EXPECT_EQ(set, testing::read_text(folder_.file("b.csv")));
  const std::size_t first = set.find('\n') + 1;
  EXPECT_NEAR(std::stod(set.substr(first)), 14.0 / 3.0, 1e-12) << set;
  ASSERT_EQ(graybox("problem from-jacobians two.csv --noise 0.5,2 -o c.csv").exit_code, 0);
  const std::string other = testing::read_text(folder_.file("c.csv"));
  EXPECT_NE(other.find("\n6.25,11,20\n"), std::string::npos) << other;
}

TEST_F(JacobianCommand, RefusesWhatDoesNotFit) {
  testing::write_text(folder_.file("j.csv"), "a,b\n1,2\n3,4\n5,7\n");
  const std::string start = "problem from-jacobians j.csv -o set.h5 ";
  expect_refused(start + "--noise 0", "noise: the standard deviation 0 must be a positive number");
  expect_refused(start + "--noise 0.1,0.2", "--noise: 2 standard deviations, but 1 outputs");
  expect_refused(start + "--outputs 2", "j.csv: 3 rows are no multiple of --outputs 2");
  expect_refused(start + "--model logistic", "needs nominal parameters: --at");
  expect_refused(start + "--model logistic --at a=1", "--at: no number for 'b'");
  expect_refused(start + "--model logistic --at a=1,c=2", "j.csv has no column 'c'");
  expect_refused(start + "--model poisson --at 1,2,3", "3 are given");
  expect_refused(start + "--model poisson --at 1,2 --noise 1", "--noise is for --model linear");
  expect_refused(start + "--at 1,2", "--at is for --model logistic and poisson");
  testing::write_text(folder_.file("places.csv"), "x\n1\n2\n");
  expect_refused(start + "--candidates places.csv",
                 "places.csv: 2 rows, but there are 3 candidates");
  testing::write_text(folder_.file("j.csv"), "candidate,a\n1,2\n1,3\n2,4\n");
  expect_refused(start, "j.csv: line 4: candidate 2 has 1 rows, but the first has 2");
  testing::write_text(folder_.file("j.csv"), "candidate,a\n1,2\n2,3\n1,4\n");
  expect_refused(start, "j.csv: line 4: candidate 1 is there already");
  testing::write_text(folder_.file("j.csv"), "a,b\n1,2\n3\n");
  expect_refused(start, "j.csv: line 3: 1 numbers, but 2 in the first row");
  testing::write_text(folder_.file("j.csv"), "a,b\n1,2\n3,inf\n");
  expect_refused(start, "j.csv: line 3, column 2: inf is not finite");
}

}  // namespace
}  // namespace graybox
