// T-optimal designs: closed forms, the best fit of a rival by least squares, random rivals against
// a fine grid of designs, and the invariances.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/discrimination/discrimination_problem.hpp"
#include "tests/support/criterion_sets.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Jacobians columns(const std::string& source, const MatrixXd& values,
                  std::vector<std::string> names = {}) {
  Jacobians out{.candidates = static_cast<std::size_t>(values.rows()),
                .parameters = static_cast<std::size_t>(values.cols())};
  for (Index i = 0; i < values.rows(); ++i) {
    for (Index j = 0; j < values.cols(); ++j) out.values.push_back(values(i, j));
  }
  out.names = std::move(names);
  out.source = source;
  return out;
}

MatrixXd powers_at(int degree, int half) {
  const std::vector<double> grid = testing_sets::even_grid(half);
  MatrixXd x(static_cast<Index>(grid.size()), degree + 1);
  for (std::size_t i = 0; i < grid.size(); ++i) {
    for (int k = 0; k <= degree; ++k) x(static_cast<Index>(i), k) = std::pow(grid[i], k);
  }
  return x;
}

const JacobianNoise kUnitNoise = JacobianNoise::deviations(std::vector<double>{1.0});

Certificate solved(const DiscriminationProblem& problem, Design& design, double gap = 1e-7) {
  const Criterion criterion = problem.criterion({});
  const Solution solution =
      ColumnGeneration().solve(problem.set, {.duality_gap = gap, .criterion = criterion});
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
  design = solution.design;
  const Certificate proof = certify(problem.set, design, criterion, gap);
  EXPECT_TRUE(proves(proof, 1.1 * gap)) << proof.duality_gap;
  return proof;
}

// min over theta of sum lambda_i (y_i - J_i theta)^2.
double least_squares(const VectorXd& y, const MatrixXd& j, const std::vector<double>& weights) {
  const VectorXd root =
      Eigen::Map<const VectorXd>(weights.data(), y.size()).cwiseMax(0.0).cwiseSqrt();
  const MatrixXd a = root.asDiagonal() * j;
  const VectorXd b = root.cwiseProduct(y);
  return (b - a * a.colPivHouseholderQr().solve(b)).squaredNorm();
}

// Atkinson and Fedorov 1975: a constant against 1 + x + x^2 on [-1, 1] is half of the experiments
// where that is least, at -1/2, and half where it is largest: the square of half the difference.
TEST(Discrimination, AConstantAgainstAQuadratic) {
  const MatrixXd x = powers_at(2, 20);
  const VectorXd y = x.rowwise().sum();
  const DiscriminationProblem problem = discrimination_problem(
      columns("truth", y), std::vector{columns("constant.csv", x.leftCols(1))}, kUnitNoise);
  Design design;
  solved(problem, design);
  EXPECT_NEAR(misfits(problem, design)[0], std::pow(0.5 * (3.0 - 0.75), 2), 1e-6);
  EXPECT_NEAR(design.weights[10], 0.5, 1e-3);
  EXPECT_NEAR(design.weights[40], 0.5, 1e-3);
  EXPECT_EQ(problem.rivals.front(), "constant");
}

// A line against x^2: a quarter at each end and half in the middle leave (1/2)^2.
TEST(Discrimination, ALineAgainstAParabola) {
  const MatrixXd x = powers_at(2, 10);
  const DiscriminationProblem problem = discrimination_problem(
      columns("truth", x.col(2)), std::vector{columns("line", x.leftCols(2))}, kUnitNoise);
  Design design;
  solved(problem, design);
  EXPECT_NEAR(misfits(problem, design)[0], 0.25, 1e-7);
}

TEST(Discrimination, NoiseAndOffsetsCount) {
  const MatrixXd x = powers_at(2, 10);
  MatrixXd shifted(x.rows(), 3);
  shifted << x.leftCols(2), x.col(1) * 3.0 + VectorXd::Constant(x.rows(), 5.0);
  const Jacobians rival = columns("line", shifted, {"a", "b", "prediction"});
  const DiscriminationProblem problem =
      discrimination_problem(columns("truth", x.col(2)), std::vector{rival},
                             JacobianNoise::deviations(std::vector<double>{0.1}));
  Design design;
  solved(problem, design);
  EXPECT_NEAR(misfits(problem, design)[0], 25.0, 1e-5);
  EXPECT_EQ(problem.set.dimension(), 3U);
}

// 200 random problems of three candidates: all designs on a grid, by least squares.
TEST(Discrimination, NoDesignIsBetterThanTheCertificateAllows) {
  Random random(4);
  for (int round = 0; round < 200; ++round) {
    const Index d = 1 + round % 2;
    const int count = 3;
    const VectorXd y = testing_sets::gaussian(count, 1, random);
    std::vector<MatrixXd> models{testing_sets::gaussian(count, d, random)};
    if (round % 3 > 0) models.emplace_back(testing_sets::gaussian(count, 1, random));
    std::vector<Jacobians> rivals;
    for (const MatrixXd& each : models) rivals.push_back(columns("rival", each));
    const DiscriminationProblem problem =
        discrimination_problem(columns("truth", y), rivals, kUnitNoise);
    Design design;
    const Certificate proof = solved(problem, design, 1e-6);
    const auto worst = [&](const std::vector<double>& weights) {
      double least = std::numeric_limits<double>::infinity();
      for (const MatrixXd& each : models) least = std::min(least, least_squares(y, each, weights));
      return least;
    };
    const std::vector<double> reached = misfits(problem, design);
    EXPECT_NEAR(*std::ranges::min_element(reached), worst(design.weights),
                1e-6 * worst(design.weights));
    double best = 0.0;
    constexpr int kSteps = 60;
    for (int a = 0; a <= kSteps; ++a) {
      for (int b = 0; a + b <= kSteps; ++b) {
        best =
            std::max(best, worst({static_cast<double>(a) / kSteps, static_cast<double>(b) / kSteps,
                                  static_cast<double>(kSteps - a - b) / kSteps}));
      }
    }
    EXPECT_LE(best, worst(design.weights) * (1.0 + largest_gap(proof)) * (1.0 + 1e-9));
    EXPECT_GE(best, 0.9 * worst(design.weights));
  }
}

TEST(Discrimination, RefusesWhatNoExperimentTellsApart) {
  const MatrixXd x = powers_at(2, 5);
  const Jacobians truth = columns("truth.csv", x.rowwise().sum());
  const auto refuse = [&](const Jacobians& rival, const std::string& text) {
    try {
      static_cast<void>(discrimination_problem(truth, std::vector{rival}, kUnitNoise));
      FAIL() << "taken: " << text;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    }
  };
  refuse(columns("all.csv", x), "it can predict all");
  MatrixXd twice(x.rows(), 2);
  twice << x.col(1), 2.0 * x.col(1);
  refuse(columns("twice.csv", twice), "can't be estimated");
  refuse(columns("short.csv", x.topRows(3)), "3 candidates");
  EXPECT_THROW(static_cast<void>(discrimination_problem(columns("two", x.leftCols(2)),
                                                        std::vector{truth}, kUnitNoise)),
               InputError);
}

}  // namespace
}  // namespace graybox
