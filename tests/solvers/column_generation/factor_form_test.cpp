// Sets in factor form, H_i = F_i^T F_i: solved and certified by their factors, with the answer of
// the same sets as matrices and without making any.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "problems/kernels/factor_kernels.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/column_generation/screening.hpp"
#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/pricing/candidate_pricer.hpp"
#include "solvers/registry.hpp"
#include "tests/support/design_sets.hpp"
#include "tests/support/factor_sets.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/true_gap.hpp"

namespace graybox {
namespace {

using namespace testing_sets;

constexpr double kGap = 1e-9;

Solution solve(const InformationSet& set, std::uint64_t seed = 1) {
  SolveOptions options;
  options.duality_gap = kGap;
  options.seed = seed;
  return ColumnGeneration().solve(set, options);
}

// Solved and certified by factors alone; the matrices certify the same design.
Design expect_solved(const InformationSet& factors) {
  const Solution solution = solve(factors);
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
  const Certificate proof = certify(factors, solution.design, {}, kGap);
  EXPECT_TRUE(proves(proof, kGap)) << proof.duality_gap << " +- " << proof.rounding_bound;
  EXPECT_FALSE(factors.has_matrices());
  const Certificate other = certify(as_matrices(factors), solution.design, {}, kGap);
  EXPECT_NEAR(other.duality_gap, proof.duality_gap,
              other.rounding_bound + proof.rounding_bound + 1e-13);
  EXPECT_NEAR(other.log_det, proof.log_det, 1e-11 * (1.0 + std::abs(proof.log_det)));
  return solution.design;
}

TEST(FactorKernels, PriceAsTheMatricesDo) {
  Random random(1);
  for (std::size_t d = 1; d <= 21; ++d) {
    for (const std::size_t rank : {1U, 2U, 3U, 5U, 40U}) {
      const std::size_t count = 1 + random.below(150);
      const InformationSet set = gaussian_factors(count, rank, d, 7 * d + rank);
      const Eigen::MatrixXd g =
          gaussian(static_cast<Eigen::Index>(d), static_cast<Eigen::Index>(d) + 1, random);
      std::vector<double> m(set.packed_size());
      const Eigen::MatrixXd full = g * g.transpose();
      pack(full.data(), d, m.data());
      InverseCholesky inverse(d);
      ASSERT_TRUE(inverse.factor(m));
      CandidatePricer pricer(set, inverse);
      std::vector<double> all(count), listed(count);
      pricer.price(0, count, all.data());
      std::vector<std::size_t> order(count);
      for (std::size_t& i : order) i = random.below(count);
      pricer.price(order, listed.data());
      for (std::size_t k = 0; k < count; ++k) EXPECT_EQ(listed[k], all[order[k]]);
      if (count > 3) {  // each is computed alone
        pricer.price(3, count - 3, listed.data());
        for (std::size_t k = 3; k < count; ++k) EXPECT_EQ(listed[k - 3], all[k]);
      }
      const Eigen::LLT<Eigen::MatrixXd> llt(full);
      for (std::size_t i = 0; i < count; ++i) {
        const double w = llt.solve(matrix_of(as_matrices(set.subset(std::vector{i})), 0)).trace();
        EXPECT_NEAR(all[i], w, 1e-9 * w) << d << ' ' << rank;
      }
    }
  }
}

TEST(FactorForm, WhitenedNormsAreThoseOfTheMatrices) {
  constexpr std::size_t kD = 5;
  for (const std::size_t rank : {1U, 2U, 4U, 7U}) {
    const InformationSet set = gaussian_factors(20, rank, kD, rank);
    std::vector<double> m(set.packed_size()), row(set.packed_size());
    information_matrix(set, std::vector<double>(20, 0.05), m);
    InverseCholesky inverse(kD);
    ASSERT_TRUE(rank * 20 > kD && inverse.factor(m));
    std::vector<double> scratch(2 * kD * kD), other(rank * kD);
    for (std::size_t i = 0; i < 20; ++i) {
      const double expected =
          squared_whitened_norm(set.packed(i, row).data(), inverse.inverse_factor(), kD, scratch);
      const double found =
          squared_whitened_norm_of_factor(set.factor(i), rank, inverse.inverse_factor(), other);
      EXPECT_NEAR(found, expected, 1e-11 * expected);
    }
  }
}

TEST(FactorForm, DesignsAreThoseOfTheMatrices) {
  for (const std::size_t rank : {1U, 2U, 6U}) {
    for (const std::size_t count : {40U, 3000U, 40000U}) {
      const InformationSet set = gaussian_factors(count, rank, 6, 10 * rank + count);
      const Design design = expect_solved(set);
      const Design other = solve(as_matrices(set)).design;
      // The optimal matrix is unique; on random candidates the weights are, too.
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_NEAR(design.weights[i], other.weights[i], 1e-4) << rank << ' ' << count << ' ' << i;
      }
    }
  }
}

TEST(FactorForm, LargeSetsAreCertifiedInLessThanTwoPasses) {
  const InformationSet set = gaussian_factors(600000, 1, 4, 5);
  const Solution solution = solve(set);
  EXPECT_EQ(solution.status, SolveStatus::kSolved);
  EXPECT_LT(solution.counters.passes, 2.0);
  EXPECT_TRUE(proves(certify(set, solution.design, {}, kGap), kGap));
  EXPECT_FALSE(set.has_matrices());
}

TEST(FactorForm, SignsAndPowersOfTwoChangeNothing) {
  const InformationSet set = gaussian_factors(5000, 2, 5, 11);
  Random random(2);
  const InformationSet signs = changed_factors(
      set, [&, sign = 1.0](double x, std::size_t, std::size_t, std::size_t j) mutable {
        if (j == 0) sign = random.uniform() < 0.5 ? -1.0 : 1.0;
        return sign * x;
      });
  const InformationSet scaled =
      changed_factors(set, [](double x, std::size_t, std::size_t, std::size_t) { return 8.0 * x; });
  const Design design = expect_solved(set);
  EXPECT_EQ(design.weights, expect_solved(signs).weights);
  EXPECT_EQ(design.weights, expect_solved(scaled).weights);
  EXPECT_EQ(set.content_hash(), signs.content_hash());
}

// F -> U F with U^T U = I: the same matrices from other factors.
TEST(FactorForm, RotatedFactorsAreTheSameProblem) {
  constexpr std::size_t kRank = 3, kD = 5;
  const InformationSet set = gaussian_factors(4000, kRank, kD, 13);
  Random random(3);
  const InformationSet rotated = [&] {
    AlignedArray factors(set.candidate_count() * kRank * kD);
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      const Eigen::MatrixXd u =
          Eigen::HouseholderQR<Eigen::MatrixXd>(gaussian(kRank, kRank, random)).householderQ();
      const Eigen::Map<const RowMajor> from(set.factor(i).data(), kRank, kD);
      Eigen::Map<RowMajor>(factors.data() + i * kRank * kD, kRank, kD) = u * from;
    }
    return InformationSet::of_factors(kD, kRank, std::move(factors));
  }();
  const Design first = expect_solved(set), second = expect_solved(rotated);
  for (std::size_t i = 0; i < first.weights.size(); ++i) {
    EXPECT_NEAR(first.weights[i], second.weights[i], 1e-4);
  }
  EXPECT_TRUE(proves(certify(set, second, {}, 2.0 * kGap), 2.0 * kGap));
}

TEST(FactorForm, UnitsCopiesAndSinglePrecision) {
  const InformationSet set = gaussian_factors(3000, 1, 6, 17);
  expect_solved(changed_factors(set, [](double x, std::size_t, std::size_t, std::size_t j) {
    return x * std::pow(10.0, 3.0 * static_cast<double>(j) - 8.0);
  }));
  expect_solved(changed_factors(set, [](double x, std::size_t, std::size_t, std::size_t) {
    return static_cast<double>(static_cast<float>(x));
  }));
  const InformationSet copies = factor_set(
      6000, 1, 6, [&](std::size_t i, std::size_t, std::size_t j) { return set.factor(i / 2)[j]; });
  expect_solved(copies);
  // Fine grids of a smooth curve: neighbours are nearly equal.
  expect_solved(factor_set(20001, 1, 5, [](std::size_t i, std::size_t, std::size_t j) {
    return std::pow(-1.0 + static_cast<double>(i) / 1e4, static_cast<double>(j));
  }));
}

// Coordinates in which double precision loses nearly all digits: factors are whitened, not
// matrices.
TEST(FactorForm, IllConditionedFactorsAreWhitened) {
  constexpr std::size_t kD = 5;
  Random random(4);
  const InformationSet set =
      factor_set(3000, 1, kD, [&, common = 0.0](std::size_t, std::size_t, std::size_t j) mutable {
        if (j == 0) common = random.normal();
        return common + 1e-5 * random.normal();
      });
  const Solution solution = solve(set);
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
  EXPECT_FALSE(set.has_matrices());
  const Certificate proof = certify(set, solution.design, {}, kGap);
  EXPECT_TRUE(proves(proof, kGap)) << proof.duality_gap << " +- " << proof.rounding_bound;
  Tracer tracer(set, {}, nullptr);
  const ConditionedSet conditioned(set, 0.0, tracer);
  EXPECT_TRUE(conditioned.whitened() && conditioned.set().has_factors());
  EXPECT_TRUE(proves(certify(conditioned.set(), solution.design, {}, kGap), kGap));
}

// The gap of random designs against 113 bits: within the bound, whatever the condition.
TEST(FactorForm, TheCheckersBoundHoldsTheTrueGap) {
  Random random(6);
  for (const double noise : {1.0, 1e-3, 1e-6}) {
    for (const std::size_t rank : {1U, 3U}) {
      const InformationSet set = factor_set(
          60, rank, 6, [&, common = 0.0](std::size_t, std::size_t, std::size_t j) mutable {
            if (j == 0) common = static_cast<double>(static_cast<float>(random.normal()));
            return common + static_cast<double>(static_cast<float>(noise * random.normal()));
          });
      Design design{std::vector<double>(60)};
      for (double& w : design.weights) w = random.uniform();
      const double sum = std::accumulate(design.weights.begin(), design.weights.end(), 0.0);
      for (double& w : design.weights) w /= sum;
      const Certificate proof = certify(set, design);
      ASSERT_EQ(proof.status, CertificateStatus::kCertified);
      EXPECT_FALSE(set.has_matrices());
      const double gap = true_gap(set, design);
      EXPECT_LE(std::abs(gap - proof.duality_gap), proof.rounding_bound) << noise << ' ' << rank;
      EXPECT_LE(proof.rounding_bound, 0.1 * std::max(gap, kFinestGap));
    }
  }
}

// A bound that is wrong by design is refuted: weights that are not optimal prove nothing.
TEST(FactorForm, ADesignThatIsNotOptimalIsNotCertified) {
  const InformationSet set = gaussian_factors(500, 1, 4, 23);
  Design design = solve(set).design;
  const auto largest = std::ranges::max_element(design.weights);
  const double moved = 0.01 * *largest;
  *largest -= moved;
  design.weights[design.weights[0] > 0.0 ? 1 : 0] += moved;
  const Certificate proof = certify(set, design, {}, kGap);
  EXPECT_FALSE(proves(proof, 1e-4));
  EXPECT_NEAR(proof.duality_gap, true_gap(set, design), proof.rounding_bound);
}

TEST(FactorForm, OtherBackEndsAndCriteriaMakeTheMatrices) {
  const SolverRegistry registry = make_registry();
  for (const char* name : {"dual_interior_point", "vertex_exchange"}) {
    const InformationSet set = gaussian_factors(300, 1, 4, 29);
    SolveOptions options;
    options.duality_gap = 1e-6;
    const Solution solution = registry.at(name).solve(set, options);
    EXPECT_TRUE(set.has_matrices());
    EXPECT_TRUE(proves(certify(set, solution.design, {}, 1e-6), 1e-6)) << name;
  }
  const InformationSet set = gaussian_factors(300, 2, 4, 31);
  SolveOptions options;
  options.criterion = Criterion::a();
  const Solution solution = registry.at("column_generation").solve(set, options);
  EXPECT_TRUE(proves(certify(set, solution.design, options.criterion, 1e-6), 1e-6));
}

TEST(FactorForm, StartsFromADesign) {
  const InformationSet set = gaussian_factors(20000, 1, 5, 37);
  const Design design = solve(set).design;
  SolveOptions options;
  options.duality_gap = kGap;
  options.start = design.weights;
  const Solution again = ColumnGeneration().solve(set, options);
  EXPECT_EQ(again.status, SolveStatus::kSolved);
  EXPECT_LE(again.counters.passes, 1.1);
  EXPECT_FALSE(set.has_matrices());
}

TEST(FactorForm, ThreadsDoNotChangeTheAnswer) {
  const InformationSet set = gaussian_factors(70000, 2, 4, 41);
  SolveOptions options;
  options.duality_gap = kGap;
  const Solution one = ColumnGeneration().solve(set, options);
  options.threads = 2;
  EXPECT_EQ(one.design.weights, ColumnGeneration().solve(set, options).design.weights);
}

}  // namespace
}  // namespace graybox
