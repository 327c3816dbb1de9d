// The concentration limit: the linear maximum over its polytope against enumeration of vertices,
// and the constrained designs against closed forms, a refined grid and the certificate's promise.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "problems/base/error.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/robust/concentration_interior_point.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing_sets::from_matrices;
using testing_sets::matrices_of;
using testing_sets::wishart;

double log_det(const InformationSet& set, const VectorXd& weights) {
  MatrixXd m =
      MatrixXd::Zero(static_cast<Index>(set.dimension()), static_cast<Index>(set.dimension()));
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    m += weights(static_cast<Index>(i)) * testing_sets::matrix_of(set, i);
  }
  return std::log(m.determinant());
}

VectorXd weights_of(const Design& design) {
  return Eigen::Map<const VectorXd>(design.weights.data(),
                                    static_cast<Index>(design.weights.size()));
}

double top_sum(VectorXd weights, std::size_t positions) {
  std::ranges::sort(weights, std::greater<>());
  return weights.head(static_cast<Index>(positions)).sum();
}

// A random point of the polytope: a random point of the simplex, moved towards equal weights.
VectorXd random_feasible(Index count, const ConcentrationLimit& limit, Random& random) {
  VectorXd weights(count);
  for (double& w : weights) w = std::pow(random.uniform(), 4.0);
  weights /= weights.sum();
  const double top = top_sum(weights, limit.positions);
  const double equal = static_cast<double>(limit.positions) / static_cast<double>(count);
  if (top <= limit.share) return weights;
  const double mixed = (top - limit.share) / (top - equal);
  return (1.0 - mixed) * weights + VectorXd::Constant(count, mixed / static_cast<double>(count));
}

// The maximum of a linear function over the polytope by trying every basis of its constraints: all
// sums of r weights <= alpha, all weights >= 0, and the simplex.
double maximum_over_vertices(const VectorXd& gains, const ConcentrationLimit& limit) {
  const auto q = gains.size();
  std::vector<VectorXd> rows;
  std::vector<double> bounds;
  for (int mask = 0; mask < (1 << q); ++mask) {
    if (__builtin_popcount(static_cast<unsigned>(mask)) != static_cast<int>(limit.positions)) {
      continue;
    }
    VectorXd row(q);
    for (Index i = 0; i < q; ++i) row(i) = (mask >> i) & 1;
    rows.push_back(row);
    bounds.push_back(limit.share);
  }
  for (Index i = 0; i < q; ++i) {
    rows.push_back(-VectorXd::Unit(q, i));
    bounds.push_back(0.0);
  }
  double best = -1.0;
  const std::size_t count = rows.size();
  std::vector<bool> chosen(count, false);
  std::fill(chosen.begin(), chosen.begin() + (q - 1), true);
  do {
    MatrixXd basis(q, q);
    VectorXd right(q);
    basis.row(0).setOnes();
    right(0) = 1.0;
    Index at = 1;
    for (std::size_t k = 0; k < count; ++k) {
      if (!chosen[k]) continue;
      basis.row(at) = rows[k];
      right(at++) = bounds[k];
    }
    const Eigen::FullPivLU<MatrixXd> factor(basis);
    if (!factor.isInvertible()) continue;
    const VectorXd vertex = factor.solve(right);
    bool feasible = true;
    for (std::size_t k = 0; k < count && feasible; ++k) {
      feasible = rows[k].dot(vertex) <= bounds[k] + 1e-10;
    }
    if (feasible) best = std::max(best, gains.dot(vertex));
  } while (std::prev_permutation(chosen.begin(), chosen.end()));
  return best;
}

TEST(ConcentrationLimit, LinearMaximumIsThatOfTheVertices) {
  Random random(5);
  for (int trial = 0; trial < 60; ++trial) {
    const auto q = static_cast<Index>(2 + random.below(4));
    const auto r = static_cast<std::size_t>(1 + random.below(static_cast<std::uint64_t>(q)));
    const double least = static_cast<double>(r) / static_cast<double>(q);
    const double share = trial % 5 == 0 ? least : least + (1.0 - least) * random.uniform();
    const ConcentrationLimit limit{share, r};
    VectorXd gains(q);
    for (double& g : gains)
      g = trial % 3 == 0 ? 1.0 + static_cast<double>(random.below(3)) : random.uniform();
    const std::vector<Extended> extended(gains.begin(), gains.end());
    const LinearMaximum maximum = maximise_over_limit(extended, limit);
    EXPECT_NEAR(static_cast<double>(maximum.value), maximum_over_vertices(gains, limit), 1e-9)
        << q << " candidates, " << r << " positions, share " << share;
    EXPECT_GE(maximum.price, Extended{0});
  }
}

TEST(ConcentrationLimit, LinearMaximumBoundsEveryFeasibleDesign) {
  Random random(6);
  const ConcentrationLimit limit = concentration_limit(0.4, 0.1, 50);
  EXPECT_EQ(limit.positions, 5U);
  VectorXd gains(50);
  for (double& g : gains) g = random.uniform();
  const std::vector<Extended> extended(gains.begin(), gains.end());
  const auto bound = static_cast<double>(maximise_over_limit(extended, limit).value);
  for (int k = 0; k < 1000; ++k) {
    EXPECT_LE(gains.dot(random_feasible(50, limit, random)), bound + 1e-12);
  }
}

TEST(ConcentrationLimit, RefusesWhatCannotBe) {
  EXPECT_EQ(concentration_limit(0.5, 0.07, 100).positions, 7U);  // 0.07 * 100 < 7 in binary
  EXPECT_EQ(concentration_limit(0.5, 0.079, 100).positions, 7U);
  EXPECT_EQ(concentration_limit(1.0, 1.0, 100).positions, 100U);
  EXPECT_NO_THROW(static_cast<void>(concentration_limit(0.1, 0.1, 100)));
  EXPECT_THROW(static_cast<void>(concentration_limit(0.09, 0.1, 100)), InputError);
  for (const double bad : {0.0, -0.1, 1.1, std::nan("")}) {
    EXPECT_THROW(static_cast<void>(concentration_limit(bad, 0.1, 100)), InputError) << bad;
    EXPECT_THROW(static_cast<void>(concentration_limit(0.5, bad, 100)), InputError) << bad;
  }
  EXPECT_THROW(static_cast<void>(concentration_limit(0.5, 0.009, 100)), InputError);
}

TEST(ConcentratedDesign, ObeysTheLimitAndIsCertified) {
  Random random(7);
  for (int trial = 0; trial < 20; ++trial) {
    const InformationSet set = wishart(3, 40, 2, 100 + static_cast<std::uint64_t>(trial), 1.0);
    const double share = 0.1 + 0.85 * random.uniform();
    const ConcentrationLimit limit = concentration_limit(share, 0.1, 40);
    const Solution answer = solve_concentrated(set, limit, {.duality_gap = 1e-8});
    ASSERT_EQ(answer.status, SolveStatus::kSolved) << answer.message << ", share " << share;
    const auto proof = certify_concentrated(set, answer.design, limit);
    ASSERT_EQ(proof.certificate.status, CertificateStatus::kCertified) << proof.certificate.message;
    EXPECT_LE(proof.certificate.duality_gap, 1e-8);
    EXPECT_LE(proof.certificate.rounding_bound, 1e-10);
    EXPECT_LE(top_sum(weights_of(answer.design), limit.positions), share + 1e-9);
    EXPECT_NEAR(weights_of(answer.design).sum(), 1.0, 1e-12);
  }
}

TEST(ConcentratedDesign, MatchesARefinedGridOfThreeWeights) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
    const InformationSet set = wishart(2, 3, 1, seed, 1.0);
    for (const double share : {0.4, 0.5, 0.7}) {
      const ConcentrationLimit limit = concentration_limit(share, 1.0 / 3.0, 3);
      double best = -1e300;
      constexpr int kSteps = 400;
      for (int a = 0; a <= kSteps; ++a) {
        for (int b = 0; a + b <= kSteps; ++b) {
          VectorXd weights(3);
          weights << a, b, kSteps - a - b;
          weights /= kSteps;
          if (weights.maxCoeff() <= share + 1e-12) best = std::max(best, log_det(set, weights));
        }
      }
      const Solution answer = solve_concentrated(set, limit, {.duality_gap = 1e-9});
      const double ours = log_det(set, weights_of(answer.design));
      EXPECT_GE(ours, best - 1e-8) << "seed " << seed << ", share " << share;
      EXPECT_LE(ours, best + 1e-3) << "seed " << seed << ", share " << share;
    }
  }
}

// Each parameter has a strong candidate (information a) and a weak one (b). With at most alpha on
// any d of the 2 d candidates, the strong ones share alpha equally.
TEST(ConcentratedDesign, ClosedFormOfStrongAndWeakCandidates) {
  constexpr Index kD = 4;
  constexpr double kStrong = 5.0, kWeak = 2.0;
  std::vector<MatrixXd> matrices;
  for (Index k = 0; k < kD; ++k) {
    matrices.emplace_back(kStrong * VectorXd::Unit(kD, k) * VectorXd::Unit(kD, k).transpose());
    matrices.emplace_back(kWeak * VectorXd::Unit(kD, k) * VectorXd::Unit(kD, k).transpose());
  }
  const InformationSet set = from_matrices(matrices);
  for (const double share : {0.5, 0.6, 0.8, 0.99, 1.0}) {
    const ConcentrationLimit limit = concentration_limit(share, 0.5, 2 * kD);
    const Solution answer = solve_concentrated(set, limit, {.duality_gap = 1e-10});
    const double expected = kD * std::log((kStrong * share + kWeak * (1.0 - share)) / kD);
    EXPECT_NEAR(log_det(set, weights_of(answer.design)), expected, 1e-8) << "share " << share;
    // The price is the derivative of log det by the share, except at the ends, where it is
    // one-sided.
    if (share > 0.5 && share < 1.0) {
      const double slope = kD * (kStrong - kWeak) / (kStrong * share + kWeak * (1.0 - share));
      EXPECT_NEAR(certify_concentrated(set, answer.design, limit).price, slope, 1e-4);
    }
  }
}

TEST(ConcentratedDesign, EndsOfTheRangeOfShares) {
  const InformationSet set = wishart(3, 30, 3, 11, 1.5);
  const Solution free = ColumnGeneration().solve(set, {.duality_gap = 1e-9});
  const double optimum = log_det(set, weights_of(free.design));
  const Solution whole = solve_concentrated(set, {1.0, 2}, {.duality_gap = 1e-9});
  EXPECT_NEAR(log_det(set, weights_of(whole.design)), optimum, 1e-8);
  // A limit looser than what the optimum does anyway.
  const double share = concentration(free.design.weights, 2);
  ASSERT_LT(share, 1.0);
  const ConcentrationLimit loose{0.5 * (1.0 + share), 2};
  const Solution unbound = solve_concentrated(set, loose, {.duality_gap = 1e-9});
  EXPECT_NEAR(log_det(set, weights_of(unbound.design)), optimum, 1e-8);
  EXPECT_NEAR(certify_concentrated(set, unbound.design, loose).price, 0.0, 1e-6);
  // One tighter than that binds.
  const ConcentrationLimit tight{0.9 * share, 2};
  const Solution bound = solve_concentrated(set, tight, {.duality_gap = 1e-9});
  EXPECT_NEAR(top_sum(weights_of(bound.design), 2), tight.share, 1e-7);
  EXPECT_LT(log_det(set, weights_of(bound.design)), optimum - 1e-6);
  // Only equal weights are left.
  const Solution equal = solve_concentrated(set, concentration_limit(0.1, 0.1, 30), {});
  for (const double weight : equal.design.weights) EXPECT_DOUBLE_EQ(weight, 1.0 / 30.0);
}

TEST(ConcentratedDesign, NoFeasibleDesignBeatsTheBound) {
  Random random(12);
  const InformationSet set = wishart(3, 25, 2, 13, 1.0);
  const ConcentrationLimit limit = concentration_limit(0.35, 0.12, 25);
  for (int k = 0; k < 300; ++k) {
    const VectorXd weights = random_feasible(25, limit, random);
    const auto proof = certify_concentrated(set, {{weights.begin(), weights.end()}}, limit);
    const double bound = proof.certificate.log_det + proof.certificate.log_det_gap;
    for (int j = 0; j < 5; ++j) {
      EXPECT_LE(log_det(set, random_feasible(25, limit, random)), bound + 1e-9);
    }
  }
}

TEST(ConcentratedDesign, CheckerRefusesDesignsBeyondTheLimit) {
  const InformationSet set = wishart(2, 4, 2, 3);
  const ConcentrationLimit limit{0.5, 1};
  const auto status = [&](std::vector<double> weights) {
    return certify_concentrated(set, {std::move(weights)}, limit).certificate.status;
  };
  EXPECT_EQ(status({0.5, 0.5, 0.0, 0.0}), CertificateStatus::kCertified);
  EXPECT_EQ(status({0.51, 0.49, 0.0, 0.0}), CertificateStatus::kNotADesign);
  EXPECT_EQ(status({0.5, 0.4, 0.0, 0.0}), CertificateStatus::kNotADesign);
  EXPECT_EQ(status({0.5, 0.5, 0.0}), CertificateStatus::kNotADesign);
}

TEST(ConcentratedDesign, DoesNotDependOnOrderCoordinatesOrScale) {
  const InformationSet set = wishart(3, 40, 2, 21, 1.0);
  const ConcentrationLimit limit = concentration_limit(0.4, 0.1, 40);
  const double d = 3.0;
  const double value =
      log_det(set, weights_of(solve_concentrated(set, limit, {.duality_gap = 1e-9}).design));
  std::vector<MatrixXd> reversed = matrices_of(set);
  std::ranges::reverse(reversed);
  const InformationSet backwards = from_matrices(reversed);
  EXPECT_NEAR(
      log_det(backwards,
              weights_of(solve_concentrated(backwards, limit, {.duality_gap = 1e-9}).design)),
      value, 1e-8);
  Random random(22);
  const MatrixXd t = testing_sets::gaussian(3, 3, random) * 100.0;
  const InformationSet moved = testing_sets::transformed(set, t);
  const Solution answer = solve_concentrated(moved, limit, {.duality_gap = 1e-9});
  EXPECT_NEAR(log_det(set, weights_of(answer.design)), value, 1e-8);
  EXPECT_LE(certify_concentrated(moved, answer.design, limit).certificate.log_det_gap, d * 1.1e-9);
}

// Duplicates: doubling every candidate and r leaves the problem as it was.
TEST(ConcentratedDesign, DoublingCandidatesAndPositionsChangesNothing) {
  const InformationSet set = wishart(3, 20, 2, 31, 1.0);
  const InformationSet twice = testing_sets::concatenated(set, set);
  const auto value = [](const InformationSet& s, const ConcentrationLimit& limit) {
    return log_det(s, weights_of(solve_concentrated(s, limit, {.duality_gap = 1e-9}).design));
  };
  EXPECT_NEAR(value(set, {0.4, 2}), value(twice, {0.4, 4}), 1e-7);
}

TEST(ConcentratedDesign, StatusesAndLimits) {
  const InformationSet set = wishart(3, 200, 2, 41, 1.0);
  const ConcentrationLimit limit = concentration_limit(0.4, 0.05, 200);
  const Solution short_run =
      solve_concentrated(set, limit, {.duality_gap = 1e-9, .iteration_limit = 3});
  EXPECT_EQ(short_run.status, SolveStatus::kIterationLimit);
  EXPECT_EQ(certify_concentrated(set, short_run.design, limit).certificate.status,
            CertificateStatus::kCertified);
  EXPECT_EQ(
      solve_concentrated(wishart(3, 5, 1, 1).subset(std::vector<std::size_t>{0, 1}), {0.9, 1}, {})
          .status,
      SolveStatus::kUnsupported);
  EXPECT_THROW(static_cast<void>(solve_concentrated(set, {0.01, 10}, {})), InputError);
  EXPECT_THROW(static_cast<void>(solve_concentrated(set, limit, {.duality_gap = 0.0})), InputError);
  const Solution one = solve_concentrated(set, limit, {.duality_gap = 1e-8, .threads = 1});
  const Solution two = solve_concentrated(set, limit, {.duality_gap = 1e-8, .threads = 2});
  EXPECT_EQ(one.design.weights, two.design.weights);
}

}  // namespace
}  // namespace graybox
