// Designs over a continuum: known optima of polynomial regression, limits, certificates, and the
// robot, whose continuous optimum is never worse than the grid's.
#include "solvers/column_generation/continuous_design.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/families/regression.hpp"
#include "problems/information/candidate_space.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "problems/robot_information/robot_space.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/box_search.hpp"
#include "solvers/core/sensitivity.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

// ---- box search --------------------------------------------------------------------------------

TEST(BoxSearch, FindsTheMaximumOfAConcaveQuadraticInsideAndOnTheBounds) {
  const std::vector<double> lower{-1.0, 0.0, 5.0, -3.0}, upper{2.0, 4.0, 5.0, -1.0};
  // The third coordinate is fixed; the maximum over the second lies beyond its upper bound.
  const auto function = [](std::span<const double> x) {
    const double a = x[0] - 0.5, b = x[1] - 6.0, c = x[3] + 2.0;
    return 3.0 - 2.0 * a * a - 0.3 * b * b - 5.0 * c * c - 0.5 * a * c + x[2];
  };
  BoxSearch search(lower, upper);
  std::vector<double> point{-1.0, 0.0, 5.0, -1.0};
  const double value = search.maximise(function, point, {.tolerance = 1e-12});
  EXPECT_NEAR(point[0], 0.5, 1e-5);
  EXPECT_EQ(point[1], 4.0);
  EXPECT_EQ(point[2], 5.0);
  EXPECT_NEAR(point[3], -2.0, 1e-5);
  EXPECT_NEAR(value, 3.0 - 0.3 * 4.0 + 5.0, 1e-9);
}

// Started in every corner and anywhere else, it stays in the box, never descends, and ends where no
// coordinate that is free to move has a slope.
TEST(BoxSearch, StaysInTheBoxAndNeverDescends) {
  const std::vector<double> lower{-2.0, -2.0}, upper{2.0, 1.0};
  double outside = 0.0;
  const auto function = [&](std::span<const double> x) {
    for (std::size_t k = 0; k < 2; ++k) {
      outside = std::max({outside, lower[k] - x[k], x[k] - upper[k]});
    }
    return std::sin(3.0 * x[0]) * std::cos(2.0 * x[1]) + 0.1 * x[0];
  };
  BoxSearch search(lower, upper);
  for (int i = 0; i <= 6; ++i) {
    for (int j = 0; j <= 6; ++j) {
      std::vector<double> point{-2.0 + 4.0 * i / 6.0, -2.0 + 3.0 * j / 6.0};
      const double before = function(point);
      const double after = search.maximise(function, point);
      EXPECT_GE(after, before);
      EXPECT_EQ(after, function(point));
      std::vector<double> slope(2);
      search.gradient(function, point, slope);
      for (std::size_t k = 0; k < 2; ++k) {
        const bool at_lower = point[k] == lower[k], at_upper = point[k] == upper[k];
        EXPECT_TRUE(at_upper || slope[k] < 1e-5) << point[0] << " " << point[1];
        EXPECT_TRUE(at_lower || slope[k] > -1e-5) << point[0] << " " << point[1];
      }
    }
  }
  EXPECT_EQ(outside, 0.0);
}

TEST(BoxSearch, GradientEqualsTheAnalyticOneInsideAndAtBounds) {
  const std::vector<double> lower{0.0, -1.0}, upper{1.0, 3.0};
  const auto function = [](std::span<const double> x) { return std::exp(x[0]) * std::sin(x[1]); };
  BoxSearch search(lower, upper);
  for (const std::vector<double>& point :
       {std::vector{0.4, 1.0}, std::vector{0.0, 3.0}, std::vector{1.0, -1.0}}) {
    std::vector<double> slope(2);
    search.gradient(function, point, slope);
    EXPECT_NEAR(slope[0], std::exp(point[0]) * std::sin(point[1]), 2e-5);
    EXPECT_NEAR(slope[1], std::exp(point[0]) * std::cos(point[1]), 2e-5);
  }
}

// ---- polynomial regression ---------------------------------------------------------------------

// H(x) = f f^T, f the Legendre polynomials up to a degree, on a range of the line.
class PolynomialSpace : public CandidateSpace {
 public:
  PolynomialSpace(std::size_t degree, double lower, double upper)
      : degree_(degree), lower_{lower}, upper_{upper} {}
  [[nodiscard]] std::size_t dimension() const override { return degree_ + 1; }
  [[nodiscard]] std::span<const double> lower() const override { return lower_; }
  [[nodiscard]] std::span<const double> upper() const override { return upper_; }
  [[nodiscard]] std::unique_ptr<InformationEvaluator> evaluator() const override {
    return std::make_unique<Evaluator>(degree_);
  }

 private:
  class Evaluator : public InformationEvaluator {
   public:
    explicit Evaluator(std::size_t degree) : degree_(degree) {}
    void information(std::span<const double> point, std::span<double> packed) override {
      std::vector<double> f{1.0, point[0]};
      for (std::size_t n = 1; n < degree_; ++n) {
        const auto k = static_cast<double>(n);
        f.push_back(((2.0 * k + 1.0) * point[0] * f[n] - k * f[n - 1]) / (k + 1.0));
      }
      for (std::size_t i = 0, k = 0; i <= degree_; ++i) {
        for (std::size_t j = 0; j <= i; ++j, ++k) packed[k] = f[i] * f[j];
      }
    }

   private:
    std::size_t degree_;
  };
  std::size_t degree_;
  std::vector<double> lower_, upper_;
};

InformationSet polynomial_grid(std::size_t degree, std::size_t points) {
  return polynomial_regression(degree, even_points(points), PolynomialBasis::kLegendre);
}

// The optimum of degree n has weight 1/(n+1) on each root of (1 - x^2) P_n'(x) (Guest, Hoel 1958).
class PolynomialDegree : public ::testing::TestWithParam<std::size_t> {};

TEST_P(PolynomialDegree, FindsTheKnownOptimum) {
  const std::size_t degree = GetParam();
  const PolynomialSpace space(degree, -1.0, 1.0);
  const InformationSet grid = polynomial_grid(degree, 12);  // has none of the inner roots
  const ContinuousResult result = solve_continuous(space, grid, {.duality_gap = 1e-8});
  ASSERT_EQ(result.status, SolveStatus::kSolved);
  EXPECT_LE(result.gap, 1e-8);
  const std::vector<double> roots = optimal_polynomial_points(degree);
  ASSERT_EQ(result.support_size(), roots.size());
  std::vector<std::size_t> order(roots.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t j) { return result.points[j]; });
  for (std::size_t j = 0; j < roots.size(); ++j) {
    EXPECT_NEAR(result.points[order[j]], roots[j], 1e-3);
    EXPECT_NEAR(result.weights[order[j]], 1.0 / static_cast<double>(degree + 1), 1e-4);
  }
  // log det of the true optimum, from the set of the roots alone.
  const InformationSet best = polynomial_regression(degree, roots, PolynomialBasis::kLegendre);
  const Certificate truth =
      certify(best, {std::vector<double>(roots.size(), 1.0 / static_cast<double>(roots.size()))});
  const auto d = static_cast<double>(degree + 1);
  EXPECT_LE(result.log_det, truth.log_det + 1e-10);
  EXPECT_GE(result.log_det, truth.log_det - d * std::log1p(1e-8) - 1e-10);
  EXPECT_LT(result.grid_log_det, truth.log_det - 1e-4);
  // What the grid's own design says of itself in the box bounds its loss.
  EXPECT_LE(truth.log_det - result.grid_log_det, d * std::log1p(result.grid_gap_in_box) + 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Degrees, PolynomialDegree, ::testing::Values(2, 3, 4, 6, 9));

TEST(ContinuousDesign, RespectsLimitsAndIsCertifiedOverGridAndSupport) {
  const PolynomialSpace space(3, -0.4, 0.9);
  std::vector<double> points;
  for (int i = 0; i <= 10; ++i) points.push_back(-0.4 + 0.13 * i);
  const InformationSet grid = polynomial_regression(3, points, PolynomialBasis::kLegendre);
  const ContinuousResult result = solve_continuous(space, grid, {.duality_gap = 1e-7});
  ASSERT_EQ(result.status, SolveStatus::kSolved);
  for (const double x : result.points) {
    EXPECT_GE(x, -0.4);
    EXPECT_LE(x, 0.9);
  }
  // The optimum on another range is the affine image of that on [-1, 1].
  std::vector<double> sorted = result.points;
  std::ranges::sort(sorted);
  const std::vector<double> roots = optimal_polynomial_points(3);
  ASSERT_EQ(sorted.size(), roots.size());
  for (std::size_t j = 0; j < roots.size(); ++j) {
    EXPECT_NEAR(sorted[j], 0.25 + 0.65 * roots[j], 1e-3);
  }
  const DesignedSet designed = grid_and_support(space, grid, result);
  EXPECT_EQ(designed.set.candidate_count(), grid.candidate_count() + result.support_size());
  const Certificate certificate = certify(designed.set, designed.design);
  EXPECT_EQ(certificate.status, CertificateStatus::kCertified);
  EXPECT_LE(certificate.duality_gap, 1e-7 + certificate.rounding_bound);
  EXPECT_NEAR(certificate.log_det, result.log_det, 1e-9);
}

TEST(ContinuousDesign, RefinedBoundFindsWhatTheGridMisses) {
  const PolynomialSpace space(5, -1.0, 1.0);
  const InformationSet grid = polynomial_grid(5, 7);
  const auto points = [](std::size_t i, std::span<double> out) {
    out[0] = -1.0 + 2.0 * static_cast<double>(i) / 5000.0;
  };
  // The optimum on the grid as if it were the answer: stopped before the first new column.
  const ContinuousResult on_grid =
      solve_continuous(space, grid, {}, [](const ContinuousRound&) { return false; });
  EXPECT_EQ(on_grid.status, SolveStatus::kTimeLimit);
  EXPECT_EQ(on_grid.log_det, on_grid.grid_log_det);
  const RefinedBound loose = refined_bound(space, on_grid, 5001, points, 20, 2);
  EXPECT_GT(loose.largest_priced, 1e-2);
  EXPECT_GE(loose.largest_searched, loose.largest_priced);
  EXPECT_NEAR(loose.largest_searched, on_grid.grid_gap_in_box, 1e-6);
  const ContinuousResult result = solve_continuous(space, grid, {.duality_gap = 1e-8});
  std::vector<std::string> finished;
  const RefinedBound tight =
      refined_bound(space, result, 5001, points, 20, 1,
                    [&](std::string_view piece, std::size_t done, std::size_t total) {
                      if (done == total)
                        finished.push_back(std::string(piece) + " " + std::to_string(total));
                    });
  EXPECT_EQ(finished, (std::vector<std::string>{"priced block 20", "search 20"}));
  EXPECT_LE(tight.largest_priced, 1e-7);
  EXPECT_LE(tight.largest_searched, 1e-7);
  EXPECT_LE(tight.maxima, 6U);
}

TEST(ContinuousDesign, RefusesGridsOutsideTheBoxAndBadOptions) {
  const PolynomialSpace narrow(3, -0.5, 0.5), wide(3, -1.0, 1.0);
  const InformationSet grid = polynomial_grid(3, 9);
  EXPECT_THROW((void)solve_continuous(narrow, grid), InputError);
  EXPECT_THROW((void)solve_continuous(PolynomialSpace(4, -1.0, 1.0), grid), InputError);
  EXPECT_THROW((void)solve_continuous(PolynomialSpace(3, 1.0, -1.0), grid), InputError);
  EXPECT_THROW((void)solve_continuous(wide, grid, {.duality_gap = 0.0}), InputError);
  EXPECT_THROW((void)solve_continuous(wide, grid, {.round_limit = 0}), InputError);
  EXPECT_THROW((void)solve_continuous(wide, grid, {.threads = 0}), InputError);
}

// ---- the robot ---------------------------------------------------------------------------------

TEST(RobotSpace, EvaluatesWhatTheSetHolds) {
  const RobotModel robot = robot_test::paper_robot();
  const RobotSpace space(robot, paper_ranges());
  const PositionTable grid = robot_grid(20);
  const InformationSet set = robot_information_set(robot, grid);
  const auto evaluator = space.evaluator();
  std::vector<double> packed(set.packed_size());
  for (std::size_t i = 0; i < grid.count(); ++i) {
    evaluator->information(set.coordinates(i), packed);
    for (std::size_t k = 0; k < packed.size(); ++k) {
      EXPECT_EQ(packed[k], set.information(i)[k]) << i << " " << k;
    }
  }
}

TEST(RobotSpace, KeepsToTheLimits) {
  const RobotModel robot = robot_test::paper_robot();
  const auto refused = [&](std::size_t joint, double from, double to) {
    std::vector<JointRange> ranges = paper_ranges();
    ranges[joint] = {from, to};
    EXPECT_THROW(RobotSpace(robot, ranges), InputError) << joint;
  };
  refused(0, 90.0, 0.0);
  refused(1, -60.0, 91.0);   // the URDF ends at 90
  refused(2, -200.0, 60.0);  // and at -180
  refused(3, 0.0, std::numeric_limits<double>::infinity());
  EXPECT_THROW(RobotSpace(robot, {{0.0, 90.0}}), InputError);
  EXPECT_NO_THROW(RobotSpace(robot, urdf_ranges(robot)));
  std::vector<JointRange> ranges = paper_ranges();
  ranges[0] = {0.0, 45.0};
  const PositionTable inside = RobotSpace(robot, ranges).inside(paper_grid());
  EXPECT_EQ(inside.count(), kPaperGridSize * 2 / 3);
  ranges[0] = {1.0, 44.0};
  EXPECT_THROW((void)RobotSpace(robot, ranges).inside(paper_grid()), InputError);
}

// A robot of the paper with few frequencies, on a coarse grid: quick, and the grid loses a lot.
TEST(ContinuousDesign, IsNeverWorseThanTheGridAndIndependentOfThreads) {
  RobotModel robot = robot_test::paper_robot();
  std::vector<double> frequencies;
  for (std::size_t f = 0; f < robot.frequencies.size(); f += 10) {
    frequencies.push_back(robot.frequencies[f]);
  }
  robot.frequencies = frequencies;
  const RobotSpace space(robot, paper_ranges());
  const InformationSet grid = robot_information_set(robot, robot_grid(60));
  const ContinuousOptions options{.duality_gap = 1e-2,
                                  .round_limit = 2,
                                  .grid_starts = 3,
                                  .random_starts = 1,
                                  .random_points = 50};
  const ContinuousResult result = solve_continuous(space, grid, options);
  double last = -std::numeric_limits<double>::infinity();
  for (const ContinuousRound& round : result.rounds) {
    EXPECT_GE(round.log_det, last - 1e-9);
    last = round.log_det;
  }
  EXPECT_GT(result.log_det, result.grid_log_det + 0.05);
  for (std::size_t j = 0; j < result.support_size(); ++j) {
    for (std::size_t k = 0; k < 6; ++k) {
      EXPECT_GE(result.points[6 * j + k], space.lower()[k]);
      EXPECT_LE(result.points[6 * j + k], space.upper()[k]);
    }
  }
  ContinuousOptions threaded = options;
  threaded.threads = 2;
  const ContinuousResult again = solve_continuous(space, grid, threaded);
  EXPECT_EQ(again.points, result.points);
  EXPECT_EQ(again.weights, result.weights);
}

}  // namespace
}  // namespace graybox
