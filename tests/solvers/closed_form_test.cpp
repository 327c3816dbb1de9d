// Problems whose optimum is known in closed form, solved by every back-end that promises 1e-6.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "solvers/certificates/certificate.hpp"
#include "tests/support/design_sets.hpp"
#include "tests/support/registered_solvers.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using namespace testing_solvers;
using Eigen::MatrixXd;
using Eigen::VectorXd;

using Check = std::function<void(const Design&, const Certificate&)>;

// Runs all back-ends that promise the gap; `check` sees each answer with its certificate.
void for_each_solution(const InformationSet& set, const Check& check) {
  int solved = 0;
  for (const std::string& name : available_names()) {
    const Solver& solver = registry().at(name);
    if (solver.traits().reachable_gap > kGap) continue;
    SCOPED_TRACE(name);
    const Solution solution =
        solver.solve(set, {.duality_gap = kGap, .time_limit = time_limit(solver)});
    if (solution.status != SolveStatus::kSolved) {
      EXPECT_TRUE(solution.status == SolveStatus::kUnsupported || !promises_the_gap(solver))
          << to_string(solution.status) << ": " << solution.message;
      continue;
    }
    const Certificate proof = certify(set, solution.design);
    EXPECT_EQ(proof.status, CertificateStatus::kCertified);
    EXPECT_LE(proof.duality_gap, 1.001 * kGap + proof.rounding_bound);
    check(solution.design, proof);
    ++solved;
  }
  EXPECT_GE(solved, 6);
}

// The design stated is optimal (by the equivalence theorem), and so each answer has its log det to
// within the bound.
void expect_optimum(const InformationSet& set, const Design& known, const Check& more = {}) {
  const Certificate best = certify(set, known);
  ASSERT_EQ(best.status, CertificateStatus::kCertified);
  ASSERT_LE(best.duality_gap, 1e-9);
  for_each_solution(set, [&](const Design& design, const Certificate& proof) {
    EXPECT_LE(best.log_det - proof.log_det, proof.log_det_gap + 1e-9);
    EXPECT_LE(proof.log_det - best.log_det, best.log_det_gap + 1e-9);
    if (more) more(design, proof);
  });
}

// P_n(x) and P'_n(x) by the three-term recurrence.
std::pair<double, double> legendre(int n, double x) {
  double previous = 1.0, value = x;
  for (int k = 2; k <= n; ++k) {
    const double next = ((2 * k - 1) * x * value - (k - 1) * previous) / k;
    previous = std::exchange(value, next);
  }
  return {value, n * (x * value - previous) / (x * x - 1.0)};
}

// The n + 1 roots of (1 - x^2) P'_n(x). Newton on P'_n with
// (1 - x^2) P''_n = 2 x P'_n - n (n + 1) P_n, from the extrema of the Chebyshev polynomial.
std::vector<double> optimal_points(int n) {
  std::vector<double> points;
  for (int k = 0; k <= n; ++k) {
    double x = -std::cos(std::numbers::pi * k / n);
    for (int iteration = 0; iteration < 50 && k > 0 && k < n; ++iteration) {
      const auto [value, slope] = legendre(n, x);
      x -= slope * (1.0 - x * x) / (2.0 * x * slope - n * (n + 1) * value);
    }
    points.push_back(x);
  }
  return points;
}

VectorXd monomials(double x, int degree) {
  VectorXd f(degree + 1);
  f(0) = 1.0;
  for (Eigen::Index k = 1; k <= degree; ++k) f(k) = f(k - 1) * x;
  return f;
}

TEST(ClosedForm, PolynomialRegressionHasEqualWeightsAtTheRoots) {
  // Guest 1958, Hoel 1958: support at the roots of (1 - x^2) P'_n(x), weights 1/(n + 1).
  for (int degree = 1; degree <= 11; ++degree) {
    SCOPED_TRACE(degree);
    const std::vector<double> roots = optimal_points(degree);
    std::vector<double> grid = roots;
    for (int k = 0; k <= 50; ++k) {
      const double x = -1.0 + 0.04 * k;
      const bool is_root =
          std::ranges::any_of(roots, [&](double root) { return std::abs(root - x) < 1e-9; });
      if (!is_root) grid.push_back(x);
    }
    std::vector<VectorXd> vectors;
    for (const double x : grid) vectors.push_back(monomials(x, degree));
    Design known{std::vector<double>(grid.size(), 0.0)};
    std::fill_n(known.weights.begin(), roots.size(), 1.0 / (degree + 1));
    expect_optimum(regression(vectors), known, [&](const Design& design, const Certificate&) {
      // A neighbour on the grid may hold a little of a root's weight at a gap of 1e-6.
      for (const double root : roots) {
        double share = 0.0;
        for (std::size_t i = 0; i < grid.size(); ++i) {
          if (std::abs(grid[i] - root) < 0.027) share += design.weights[i];
        }
        EXPECT_NEAR(share, 1.0 / (degree + 1), 2e-3) << "x = " << root;
      }
    });
  }
}

TEST(ClosedForm, TwoLevelFactorialsHaveTheIdentityAsInformation) {
  // First-order model on {-1, 1}^k, and the three-level grid around it: M = I is optimal.
  for (int factors : {1, 3, 5}) {
    SCOPED_TRACE(factors);
    std::vector<VectorXd> vectors;
    Design known;
    const auto count = static_cast<int>(std::pow(3, factors));
    for (int code = 0; code < count; ++code) {
      VectorXd f = VectorXd::Ones(factors + 1);
      bool corner = true;
      for (int k = 0, rest = code; k < factors; ++k, rest /= 3) {
        f(k + 1) = rest % 3 - 1;
        corner = corner && rest % 3 != 1;
      }
      vectors.push_back(f);
      known.weights.push_back(corner ? std::exp2(-factors) : 0.0);
    }
    expect_optimum(regression(vectors), known, [](const Design&, const Certificate& proof) {
      EXPECT_NEAR(proof.log_det, 0.0, proof.log_det_gap + 1e-9);
    });
  }
}

TEST(ClosedForm, OrthogonalBlocksGetWeightsInProportionToTheirSize) {
  // H_k informs about block k alone: log det M = sum_k d_k log lambda_k + constant.
  Random random(31);
  const std::vector<Eigen::Index> sizes = {1, 4, 2, 3};
  const Eigen::Index d = 10;
  std::vector<MatrixXd> matrices;
  Design known;
  Eigen::Index begin = 0;
  for (const Eigen::Index size : sizes) {
    const MatrixXd g = gaussian(size, size, random);
    MatrixXd h = MatrixXd::Zero(d, d);
    h.block(begin, begin, size, size) = 0.1 * MatrixXd::Identity(size, size) + g * g.transpose();
    matrices.push_back(h);
    // A weaker experiment on the same block, which the optimum leaves out.
    h.block(begin, begin, size, size) *= 0.7;
    matrices.push_back(h);
    known.weights.push_back(static_cast<double>(size) / static_cast<double>(d));
    known.weights.push_back(0.0);
    begin += size;
  }
  expect_optimum(from_matrices(matrices), known, [&](const Design& design, const Certificate&) {
    for (std::size_t i = 0; i < known.weights.size(); ++i) {
      EXPECT_NEAR(design.weights[i], known.weights[i], 2e-3);
    }
  });
}

TEST(ClosedForm, MixturesAreBestAtTheVertices) {
  // Scheffe's first-order model on the simplex: pure blends, equal weights. Second order (Kiefer
  // 1961): pure and binary blends, equal weights.
  const int q = 4, levels = 4;
  for (const bool second_order : {false, true}) {
    SCOPED_TRACE(second_order);
    std::vector<VectorXd> vectors;
    Design known;
    const int support = second_order ? q * (q + 1) / 2 : q;
    for (int a = 0; a <= levels; ++a) {
      for (int b = 0; a + b <= levels; ++b) {
        for (int c = 0; a + b + c <= levels; ++c) {
          const double x[q] = {a / 4.0, b / 4.0, c / 4.0, (levels - a - b - c) / 4.0};
          VectorXd f(second_order ? support : q);
          Eigen::Index k = 0;
          for (const double xi : x) f(k++) = xi;
          for (int i = 0; second_order && i < q; ++i) {
            for (int j = 0; j < i; ++j) f(k++) = x[i] * x[j];
          }
          const auto pure = std::ranges::count(x, 1.0);
          const auto halves = std::ranges::count(x, 0.5);
          const bool supported = pure == 1 || (second_order && halves == 2);
          known.weights.push_back(supported ? 1.0 / support : 0.0);
          vectors.push_back(f);
        }
      }
    }
    expect_optimum(regression(vectors), known);
  }
}

TEST(ClosedForm, OneParameterPutsAllWeightOnTheLargest) {
  const InformationSet set =
      from_matrices({MatrixXd::Constant(1, 1, 0.5), MatrixXd::Constant(1, 1, 3.0),
                     MatrixXd::Constant(1, 1, 0.0), MatrixXd::Constant(1, 1, 2.9)});
  expect_optimum(set, {{0.0, 1.0, 0.0, 0.0}}, [](const Design& design, const Certificate&) {
    EXPECT_GT(design.weights[1], 1.0 - 1e-4);
  });
}

}  // namespace
}  // namespace graybox
