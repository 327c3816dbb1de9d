#include "solvers/interior_point/interior_point.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "solvers/certificates/certificate.hpp"
#include "solvers/interior_point/augmented_system.hpp"
#include "solvers/interior_point/dual_interior_point.hpp"
#include "solvers/interior_point/dual_interior_point_unscaled.hpp"
#include "solvers/interior_point/nesterov_todd.hpp"
#include "solvers/interior_point/primal_interior_point.hpp"
#include "solvers/interior_point/primal_interior_point_low_rank.hpp"
#include "solvers/interior_point/range_system.hpp"
#include "solvers/registry.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kGap = 1e-9;

std::vector<std::string> back_ends() {
  std::vector<std::string> names = {"primal_interior_point", "primal_interior_point_low_rank",
                                    "dual_interior_point"};
  const SolverRegistry registry = make_registry();
  for (const auto& entry : registry.entries()) {
    if (entry.name == "dual_interior_point_sparse" && entry.solver != nullptr) {
      names.push_back(entry.name);
    }
  }
  return names;
}

// Log-normal Wishart matrices S G G^T S, S = diag(exp N(0, 1)), in coordinates where parameter j is
// measured in units of 10^(decades (j/(d-1) - 1/2)).
InformationSet log_normal(Index d, std::size_t count, std::uint64_t seed, double decades) {
  Random random(seed);
  std::vector<MatrixXd> all;
  VectorXd unit(d);
  for (Index j = 0; j < d; ++j) {
    unit(j) = std::pow(10.0, decades * (static_cast<double>(j) / static_cast<double>(d - 1) - 0.5));
  }
  for (std::size_t i = 0; i < count; ++i) {
    VectorXd scale(d);
    for (double& x : scale) x = std::exp(random.normal());
    const MatrixXd g = unit.cwiseProduct(scale).asDiagonal() * gaussian(d, d, random);
    all.push_back(g * g.transpose());
  }
  return from_matrices(all);
}

InformationSet with_candidate(const InformationSet& set, const MatrixXd& extra) {
  std::vector<MatrixXd> all = matrices_of(set);
  all.insert(all.begin() + 1, extra);
  return from_matrices(all);
}

class InteriorPoint : public ::testing::TestWithParam<std::string> {
 protected:
  [[nodiscard]] const Solver& solver() const { return registry_.at(GetParam()); }

  void expect_gap(const InformationSet& set, const std::string& what) const {
    const Solution solution = solver().solve(set, {.duality_gap = kGap});
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << what << ": " << solution.message;
    const Certificate proof = certify(set, solution.design);
    ASSERT_EQ(proof.status, CertificateStatus::kCertified) << what << ": " << proof.message;
    EXPECT_LE(proof.duality_gap, kGap + proof.rounding_bound) << what;
    EXPECT_LE(solution.counters.iterations, 40) << what;
  }

 private:
  SolverRegistry registry_ = make_registry();
};

TEST_P(InteriorPoint, ReachesItsGapOnHardSets) {
  expect_gap(log_normal(6, 150, 1, 0.0), "log-normal");
  expect_gap(log_normal(6, 150, 1, 16.0), "parameters in units 16 decades apart");
  expect_gap(wishart(6, 150, 6, 2, 12.0), "information over 12 decades");
  expect_gap(wishart(6, 150, 1, 3, 12.0), "rank one over 12 decades");
  expect_gap(wishart(6, 150, 1, 4), "rank one");
  expect_gap(wishart(6, 6, 1, 5), "as many candidates as parameters");
  expect_gap(wishart(6, 1, 6, 6), "one candidate");
  InformationSet once = wishart(6, 30, 2, 7);
  std::vector<MatrixXd> repeated;
  for (int copy = 0; copy < 5; ++copy) {
    for (const MatrixXd& h : matrices_of(once)) repeated.push_back(h);
  }
  expect_gap(from_matrices(repeated), "exact duplicates");
  expect_gap(from_matrices({MatrixXd::Identity(3, 3), MatrixXd::Zero(3, 3)}), "a zero matrix");
}

TEST_P(InteriorPoint, ReachesItsGapForOneToFortyParameters) {
  for (const Index d : {1, 2, 3, 7, 20, 40}) {
    const std::size_t count = d < 20 ? 120 : 60;
    expect_gap(wishart(d, count, std::max<Index>(1, d / 2), 10 + static_cast<std::uint64_t>(d)),
               "d = " + std::to_string(d));
  }
}

TEST_P(InteriorPoint, FindsASingleOptimalCandidate) {
  for (const Index d : {1, 2, 12}) {
    const InformationSet set =
        with_candidate(wishart(d, 80, d, 20, 3.0), 1e9 * MatrixXd::Identity(d, d));
    const Solution solution = solver().solve(set, {.duality_gap = kGap});
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    EXPECT_NEAR(solution.design.weights.at(1), 1.0, 1e-8);
    EXPECT_EQ(certify(set, solution.design).support_size, 1U);
  }
}

TEST_P(InteriorPoint, AgreesWithTheDualWithinTheBounds) {
  for (const InformationSet& set :
       {log_normal(5, 80, 30, 0.0), wishart(5, 80, 1, 31), wishart(4, 60, 2, 32, 6.0)}) {
    const SolveOptions options{.duality_gap = kGap};
    const Certificate here = certify(set, solver().solve(set, options).design);
    const Certificate dual = certify(set, DualInteriorPoint().solve(set, options).design);
    EXPECT_NEAR(here.log_det, dual.log_det, here.log_det_gap + dual.log_det_gap + 1e-12);
  }
}

TEST_P(InteriorPoint, WeightsFollowPermutationsAndIgnoreCoordinates) {
  const InformationSet set = log_normal(4, 50, 40, 0.0);
  const std::vector<double> weights = solver().solve(set, {.duality_gap = kGap}).design.weights;
  std::vector<MatrixXd> reversed = matrices_of(set), transformed = reversed;
  std::ranges::reverse(reversed);
  Random random(41);
  const MatrixXd t = gaussian(4, 4, random);
  for (MatrixXd& h : transformed) h = 1e5 * t.transpose() * h * t;
  const auto other = solver().solve(from_matrices(reversed), {.duality_gap = kGap}).design.weights;
  const auto same =
      solver().solve(from_matrices(transformed), {.duality_gap = kGap}).design.weights;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    EXPECT_NEAR(other[weights.size() - 1 - i], weights[i], 1e-6);
    EXPECT_NEAR(same[i], weights[i], 1e-6);
  }
}

TEST_P(InteriorPoint, DoesNotDependOnThreads) {
  const InformationSet set = wishart(5, 700, 3, 50);
  const auto one = solver().solve(set, {.threads = 1}).design.weights;
  const auto three = solver().solve(set, {.threads = 3}).design.weights;
  EXPECT_EQ(one, three);
}

TEST_P(InteriorPoint, StopsAtItsLimits) {
  const InformationSet set = log_normal(5, 100, 60, 0.0);
  const Solution few = solver().solve(set, {.duality_gap = 1e-9, .iteration_limit = 2});
  EXPECT_EQ(few.status, SolveStatus::kIterationLimit);
  EXPECT_EQ(few.counters.iterations, 2);
  const Solution quick = solver().solve(set, {.duality_gap = 1e-9, .time_limit = 1e-9});
  EXPECT_EQ(quick.status, SolveStatus::kTimeLimit);
  for (const Solution* solution : {&few, &quick}) {
    EXPECT_EQ(certify(set, solution->design).status, CertificateStatus::kCertified);
  }
}

TEST_P(InteriorPoint, FailsHonestlyWhereDoublesEnd) {
  const InformationSet set = wishart(6, 60, 2, 70);
  const Solution solution = solver().solve(set, {.duality_gap = 1e-30});
  // No solver knows such a gap, not even where rounding brings its own figure down to zero.
  EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure);
  EXPECT_FALSE(solution.message.empty());
  EXPECT_LE(certify(set, solution.design).duality_gap, 1e-9);
}

TEST_P(InteriorPoint, RefusesASingularProblem) {
  const Solution solution = solver().solve(wishart(5, 4, 1, 80), {});
  EXPECT_EQ(solution.status, SolveStatus::kUnsupported);
  EXPECT_FALSE(solution.message.empty());
}

INSTANTIATE_TEST_SUITE_P(All, InteriorPoint, ::testing::ValuesIn(back_ends()),
                         [](const auto& test) { return test.param; });

TEST(PrimalInteriorPoint, DenseAndLowRankTakeTheSameSteps) {
  const InformationSet set = log_normal(5, 90, 90, 0.0);
  const Solution dense = PrimalInteriorPoint().solve(set, {.duality_gap = 1e-6});
  const Solution low_rank = PrimalInteriorPointLowRank().solve(set, {.duality_gap = 1e-6});
  EXPECT_EQ(dense.counters.iterations, low_rank.counters.iterations);
  ASSERT_EQ(dense.design.weights.size(), low_rank.design.weights.size());
  for (std::size_t i = 0; i < dense.design.weights.size(); ++i) {
    EXPECT_NEAR(dense.design.weights[i], low_rank.design.weights[i], 1e-8);
  }
}

// The paper's dual as written fails where parameters are measured in very different units;
// normalising the same problem is all it takes.
TEST(DualInteriorPointUnscaled, FailsOnBadUnitsWhereTheNormalisedFormDoesNot) {
  for (const double decades : {0.0, 12.0}) {
    const InformationSet set = log_normal(12, 200, 100, decades);
    const Solution written = DualInteriorPointUnscaled().solve(set, {.duality_gap = 1e-6});
    const Solution normalised = DualInteriorPoint().solve(set, {.duality_gap = 1e-6});
    EXPECT_EQ(normalised.status, SolveStatus::kSolved);
    EXPECT_EQ(written.status,
              decades > 0.0 ? SolveStatus::kNumericalFailure : SolveStatus::kSolved);
    EXPECT_EQ(certify(set, written.design).duality_gap > 1.0, decades > 0.0);
    EXPECT_TRUE(std::isinf(DualInteriorPointUnscaled().traits().reachable_gap));
  }
}

MatrixXd random_positive(Index d, Random& random) {
  const MatrixXd g = gaussian(d, d, random);
  return g * g.transpose() + 0.1 * MatrixXd::Identity(d, d);
}

TEST(NesterovTodd, MakesBothMatricesTheSameDiagonal) {
  for (const Index d : {1, 2, 6, 15}) {
    Random random(static_cast<std::uint64_t>(d));
    const MatrixXd w = random_positive(d, random), m = random_positive(d, random);
    const MatrixXd l = m.llt().matrixL();
    const MatrixXd l_inverse = l.inverse();
    const auto size = static_cast<std::size_t>(d);
    std::vector<double> factor(packed_size(size)), inverse(packed_size(size));
    for (Index i = 0, k = 0; i < d; ++i) {
      for (Index j = 0; j <= i; ++j, ++k) {
        factor[static_cast<std::size_t>(k)] = l(i, j);
        inverse[static_cast<std::size_t>(k)] = l_inverse(i, j);
      }
    }
    NesterovTodd scaling(size);
    ASSERT_TRUE(scaling.compute(w, factor, inverse));
    const MatrixXd& g = scaling.scaling();
    const MatrixXd& g_inverse = scaling.inverse_scaling();
    EXPECT_TRUE((g * g_inverse).isIdentity(1e-9));
    const MatrixXd scaled_w = g_inverse * w * g_inverse.transpose();
    const MatrixXd scaled_m = g.transpose() * m * g;
    EXPECT_TRUE(scaled_w.isApprox(scaled_m, 1e-9));
    EXPECT_TRUE(scaled_w.isApprox(MatrixXd(scaled_w.diagonal().asDiagonal()), 1e-9));
    EXPECT_TRUE(scaling.residual().isApprox(MatrixXd(scaled_w.inverse()) - scaled_w, 1e-7));

    // W + t dW touches the boundary at the step returned, and is inside before it.
    const MatrixXd dw = -random_positive(d, random);
    const double t = scaling.step_to_boundary(g_inverse * dw * g_inverse.transpose());
    EXPECT_NEAR((w + t * dw).selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0.0,
                1e-9 * t * dw.norm());
    EXPECT_TRUE(std::isinf(scaling.step_to_boundary(-g_inverse * dw * g_inverse.transpose())));
  }
}

VectorXd symmetric_vector(const MatrixXd& x) {
  const Index d = x.rows();
  VectorXd v(d * (d + 1) / 2);
  for (Index i = 0, k = 0; i < d; ++i) {
    for (Index j = 0; j <= i; ++j, ++k) v(k) = i == j ? x(i, j) : std::sqrt(2.0) * x(i, j);
  }
  return v;
}

// Against the full quasi-definite matrix, with D_i spread so far that rows are kept back.
TEST(AugmentedSystem, SolvesTheFullSystem) {
  for (const double decades : {1.0, 12.0}) {
    for (const Index d : {1, 2, 4}) {
      const std::size_t count = 17;
      const InformationSet set = wishart(d, count, 2, 110);
      const NormalizedSet normal(set, {});
      ASSERT_TRUE(normal.regular());
      Random random(111);
      const MatrixXd g_inverse = gaussian(d, d, random);
      const Index p = d * (d + 1) / 2, q = static_cast<Index>(count);
      std::vector<double> ratios(count), t(count), y(count), image(count), x(set.packed_size());
      for (double& ratio : ratios) ratio = std::pow(10.0, decades * random.uniform());

      MatrixXd full = MatrixXd::Zero(p + q, p + q);
      for (Index k = 0; k < p; ++k) {  // N: X -> R X R, R = G^-T G^-1, a column at a time
        VectorXd basis = VectorXd::Zero(p);
        basis(k) = 1.0;
        MatrixXd e(d, d);
        for (Index i = 0, l = 0; i < d; ++i) {
          for (Index j = 0; j <= i; ++j, ++l) {
            e(i, j) = e(j, i) = i == j ? basis(l) : basis(l) / std::sqrt(2.0);
          }
        }
        const MatrixXd r = g_inverse.transpose() * g_inverse;
        full.col(k).head(p) = symmetric_vector(r * e * r);
      }
      for (Index i = 0; i < q; ++i) {
        MatrixXd a(d, d);
        unpack(normal.row(static_cast<std::size_t>(i)).data(), set.dimension(), a.data());
        full.row(p + i).head(p) = symmetric_vector(a).transpose();
        full.col(p + i).head(p) = symmetric_vector(a);
        full(p + i, p + i) = -1.0 / ratios[static_cast<std::size_t>(i)];
      }
      VectorXd right_side(p + q);
      for (double& value : right_side) value = random.normal();
      std::copy_n(right_side.data(), p, x.data());
      std::copy_n(right_side.data() + p, q, t.data());

      AugmentedSystem system(normal, make_dense_range_system(normal, 1));
      ASSERT_TRUE(system.factorise(g_inverse, ratios));
      system.solve(x, t, y, image);
      const VectorXd expected = full.fullPivLu().solve(right_side);
      for (Index k = 0; k < p; ++k) {
        EXPECT_NEAR(x[static_cast<std::size_t>(k)], expected(k), 1e-6 * expected.head(p).norm());
      }
      const VectorXd rows = full.bottomLeftCorner(q, p) * expected.head(p);
      for (Index i = 0; i < q; ++i) {
        EXPECT_NEAR(y[static_cast<std::size_t>(i)], expected(p + i),
                    1e-8 * expected.tail(q).norm());
        EXPECT_NEAR(image[static_cast<std::size_t>(i)], rows(i), 1e-6 * (1.0 + rows.norm()));
      }
    }
  }
}

TEST(InteriorPointSteps, StopAtTheBoundary) {
  const std::vector<double> x = {1.0, 2.0, 3.0};
  EXPECT_DOUBLE_EQ(step_to_boundary(x, std::vector<double>{-0.5, -4.0, 1.0}), 0.5);
  EXPECT_TRUE(std::isinf(step_to_boundary(x, std::vector<double>{0.0, 1.0, 2.0})));
  EXPECT_LT(boundary_fraction(1e3), boundary_fraction(1e-6));
  EXPECT_LT(boundary_fraction(1e-12), 1.0);
}

}  // namespace
}  // namespace graybox
