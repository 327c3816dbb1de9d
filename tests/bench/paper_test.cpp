// The numbers behind Table I and Figures 2, 4 and 5, against direct computation.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

#include "bench/paper/covariance_table.hpp"
#include "bench/paper/experiment_curve.hpp"
#include "bench/paper/response_curve.hpp"
#include "bench/paper/robot_poses.hpp"
#include "problems/base/error.hpp"
#include "problems/families/families.hpp"
#include "problems/mechanisms/frequency_response.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox::bench {
namespace {

using robot_test::paper_robot;
using robot_test::radians;

Design optimum(const InformationSet& set) {
  return ColumnGeneration().solve(set, {.duality_gap = 1e-9}).design;
}

// Diagonal 2 x 2 matrices, so that every covariance can be done by hand.
InformationSet diagonal_set(std::initializer_list<std::pair<double, double>> diagonals) {
  AlignedArray information(3 * diagonals.size());
  std::size_t k = 0;
  for (const auto& [a, b] : diagonals) {
    information[k++] = a;
    information[k++] = 0.0;
    information[k++] = b;
  }
  return {2, std::move(information)};
}

TEST(CovarianceTable, ByHandOnDiagonalMatrices) {
  // Equal weights on diag(4, 1) and diag(1, 4): M = 2.5 I, covariance 0.4; each alone has 1/2.
  const InformationSet set = diagonal_set({{4, 1}, {1, 4}, {1, 1}});
  const CovarianceTable table = covariance_table(set, {{0.5, 0.5, 0.0}});
  EXPECT_NEAR(table.design_covariance, 0.4, 1e-15);
  ASSERT_EQ(table.rows.size(), 5U);
  EXPECT_EQ(table.rows[0].candidate, 0U);
  EXPECT_NEAR(table.rows[0].covariance, 0.5 / 0.4, 1e-14);
  EXPECT_EQ(table.rows[1].weight, 0.5);
  EXPECT_EQ(table.rows[2].kind, CovarianceRow::Kind::kMinimum);
  EXPECT_EQ(table.rows[2].candidate, 0U);
  EXPECT_EQ(table.rows[3].kind, CovarianceRow::Kind::kMedian);
  EXPECT_EQ(table.rows[3].candidate, 1U);
  EXPECT_EQ(table.rows[4].kind, CovarianceRow::Kind::kMaximum);
  EXPECT_EQ(table.rows[4].candidate, 2U);
  EXPECT_NEAR(table.rows[4].covariance, 1.0 / 0.4, 1e-14);
}

TEST(CovarianceTable, SingularCandidatesAreInfiniteAndSingularDesignsRefused) {
  const InformationSet set = diagonal_set({{1, 0}, {0, 1}});
  const CovarianceTable table = covariance_table(set, {{0.5, 0.5}});
  EXPECT_TRUE(std::isinf(table.rows[0].covariance));
  EXPECT_THROW((void)covariance_table(set, {{1.0, 0.0}}), InputError);
  EXPECT_THROW((void)covariance_table(set, {{1.0}}), InputError);
}

TEST(CovarianceTable, OfTheRobotAgreesWithTheInverseItself) {
  const RobotModel robot = paper_robot();
  const InformationSet set = robot_information_set(robot, robot_grid(40));
  const Design design = optimum(set);
  const CovarianceTable table = covariance_table(set, design);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(12, 12);
  double weights = 0.0;
  for (const CovarianceRow& row : table.rows) {
    Eigen::MatrixXd h(12, 12);
    for (Eigen::Index i = 0, k = 0; i < 12; ++i) {
      for (Eigen::Index j = 0; j <= i; ++j, ++k) {
        h(i, j) = h(j, i) = set.information(row.candidate)[static_cast<std::size_t>(k)];
      }
    }
    const double expected =
        std::pow(h.inverse().determinant(), 1.0 / 12.0) / table.design_covariance;
    EXPECT_NEAR(row.covariance / expected, 1.0, 1e-9);
    if (row.kind != CovarianceRow::Kind::kSupport) continue;
    sum += row.weight * h;
    weights += row.weight;
  }
  EXPECT_NEAR(weights, 1.0, 1e-12);
  EXPECT_NEAR(std::pow(sum.inverse().determinant(), 1.0 / 12.0) / table.design_covariance, 1.0,
              1e-9);
}

TEST(ExperimentCurve, BoundsHoldAtEveryCount) {
  const InformationSet set = make_family("wis", 60, 4, 3);
  const Design design = optimum(set);
  const auto curve = experiment_curve(set, design, {.experiments = 40, .repetitions = 200});
  ASSERT_EQ(curve.size(), 40U);
  for (const CurvePoint& point : curve) {
    EXPECT_NEAR(point.relaxed * static_cast<double>(point.experiments), 1.0, 1e-12);
    EXPECT_GE(point.rounded, point.relaxed * (1.0 - 1e-9));  // V(M lambda*) <= V(m~)
    EXPECT_GE(point.best_single, point.relaxed * (1.0 - 1e-9));
    EXPECT_GE(point.random_low, point.relaxed * (1.0 - 1e-9));
    EXPECT_LE(point.random_low, point.random_mean);
    EXPECT_LE(point.random_mean, point.random_high);
  }
  // One experiment: a random one has the mean over the candidates, up to Monte-Carlo error.
  EXPECT_NEAR(curve[0].random_mean / curve[0].random_one_mean, 1.0, 0.2);
  // Many: the rounding loss vanishes (of second order in 1/M).
  EXPECT_LT(curve[39].rounded * 40.0, 1.02);
}

TEST(ExperimentCurve, EqualCandidatesGiveOneCurve) {
  const InformationSet set = diagonal_set({{2, 3}, {2, 3}});
  const auto curve = experiment_curve(set, {{0.25, 0.75}}, {.experiments = 5, .repetitions = 10});
  for (const CurvePoint& point : curve) {
    const double expected = 1.0 / static_cast<double>(point.experiments);
    for (const double value : {point.relaxed, point.rounded, point.best_single, point.random_mean,
                               point.random_low, point.random_high, point.random_one_mean}) {
      EXPECT_NEAR(value, expected, 1e-14);
    }
  }
}

TEST(ExperimentCurve, SingularChoicesAreInfiniteAndLeftEmpty) {
  const InformationSet set = diagonal_set({{1, 0}, {0, 1}});
  const auto curve = experiment_curve(set, {{0.5, 0.5}}, {.experiments = 2, .repetitions = 50});
  EXPECT_TRUE(std::isinf(curve[0].rounded));
  EXPECT_NEAR(curve[1].rounded, 0.5, 1e-14);
  EXPECT_NE(to_csv(curve).find("\n1,1,,,,,,\n"), std::string::npos) << to_csv(curve);
  EXPECT_THROW((void)experiment_curve(set, {{0.5, 0.5}}, {.experiments = 0}), InputError);
}

TEST(ResponseCurve, SingularValuesAndTheIntegratingController) {
  const RobotModel robot = paper_robot();
  const auto curve = response_curve(robot, radians({0, 0, 0, 0, 0, 0}), {1.0, 10.0});
  const LocalModel model = LocalModelBuilder(robot).build(radians({0, 0, 0, 0, 0, 0}));
  for (const ResponsePoint& point : curve) {
    const Eigen::MatrixXcd g =
        frequency_response(model, 2.0 * std::numbers::pi * point.frequency, robot.sample_time);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXcd> gram(g.adjoint() * g);
    for (Eigen::Index i = 0; i < 6; ++i) {  // descending, the Gram matrix's are ascending
      EXPECT_NEAR(point.response(i) / std::sqrt(gram.eigenvalues()(5 - i)), 1.0, 1e-6);
    }
  }
  // |F^-1| = |1 - e^{-j w Ts}| / (K_p |1 - e^{-j w Ts} + Ts / Ti|).
  const double w = 2.0 * std::numbers::pi * 10.0;
  const std::complex<double> one(1.0), step = std::exp(std::complex<double>(0, -w * 0.0005));
  std::vector<double> expected;
  for (Eigen::Index i = 0; i < 6; ++i) {
    const double ti = robot.controller.integral_time(i), kp = robot.controller.proportional(i);
    expected.push_back(std::abs((one - step) / (kp * (one - step + 0.0005 / ti))));
  }
  std::ranges::sort(expected, std::greater<>());
  for (Eigen::Index i = 0; i < 6; ++i) {
    EXPECT_NEAR(curve[1].inverse_controller(i), expected[static_cast<std::size_t>(i)], 1e-9);
  }
  EXPECT_THROW((void)response_curve(robot, radians({0, 0}), {1.0}), InputError);
  EXPECT_THROW((void)response_curve(robot, radians({0, 0, 0, 0, 0, 0}), {1000.0}), InputError);
}

// The upright and the stretched arm by adding up the URDF's offsets.
TEST(RobotPoses, OffsetsAddUp) {
  const RobotModel robot = paper_robot();
  const auto zero = robot_pose(robot, radians({0, 0, 0, 0, 0, 0}));
  ASSERT_EQ(zero.size(), 8U);
  EXPECT_EQ(zero.front().name, "base");
  EXPECT_EQ(zero.back().name, "payload");
  EXPECT_TRUE(zero[6].place.isApprox(Eigen::Vector3d(0.320 + 1.142 + 0.2, 0, 0.78 + 1.075 + 0.2)));
  EXPECT_TRUE(zero[7].place.isApprox(zero[6].place + Eigen::Vector3d(0.1741, 0, 0), 1e-12));
  // A quarter turn of joint 1 carries x to y; joint 2 by 90 degrees lays the upper arm down.
  const auto turned = robot_pose(robot, radians({90, 90, 0, 0, 0, 0}));
  EXPECT_TRUE(turned[2].place.isApprox(Eigen::Vector3d(0, 0.320, 0.78), 1e-12));
  EXPECT_TRUE(turned[3].place.isApprox(Eigen::Vector3d(0, 0.320 + 1.075, 0.78), 1e-12));
  EXPECT_THROW((void)robot_pose(robot, radians({0, 0})), InputError);
}

TEST(RobotPoses, OneForEachSupportPosition) {
  const RobotModel robot = paper_robot();
  const InformationSet set = robot_information_set(robot, robot_grid(30));
  Design design{std::vector<double>(30, 0.0)};
  design.weights[4] = 0.25;
  design.weights[17] = 0.75;
  const auto poses = robot_poses(robot, set, design);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_EQ(poses[1].candidate, 17U);
  EXPECT_EQ(poses[1].weight, 0.75);
  EXPECT_THROW((void)robot_poses(robot, diagonal_set({{1, 1}}), {{1.0}}), InputError);
}

}  // namespace
}  // namespace graybox::bench
