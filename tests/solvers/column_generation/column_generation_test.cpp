#include "solvers/column_generation/column_generation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/families/families.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/kernels/dense_kernels.hpp"
#include "solvers/pricing/sensitivity_sample.hpp"
#include "solvers/restricted_problem/nonnegative_quadratic.hpp"
#include "solvers/restricted_problem/working_set.hpp"

namespace graybox {
namespace {

// Wishart matrices G G^T of the given rank, times exp(spread * normal).
InformationSet wishart_set(std::size_t d, std::size_t count, std::size_t rank, double spread,
                           std::uint64_t seed) {
  Random random(seed);
  AlignedArray information(count * packed_size(d));
  std::vector<double> g(d * rank);
  for (std::size_t i = 0; i < count; ++i) {
    const double scale = std::exp(spread * random.normal());
    for (double& x : g) x = random.normal();
    for (std::size_t r = 0, k = 0; r < d; ++r) {
      for (std::size_t c = 0; c <= r; ++c, ++k) {
        double sum = 0.0;
        for (std::size_t j = 0; j < rank; ++j) sum += g[r * rank + j] * g[c * rank + j];
        information[i * packed_size(d) + k] = scale * sum;
      }
    }
  }
  return InformationSet(d, std::move(information));
}

// 3^factors grid with the model 1, x_k, x_k^2: massive ties, optimum not unique.
InformationSet cube_set(std::size_t factors) {
  const std::size_t d = 1 + 2 * factors;
  std::size_t count = 1;
  for (std::size_t k = 0; k < factors; ++k) count *= 3;
  AlignedArray information(count * packed_size(d));
  std::vector<double> f(d, 1.0);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0, code = i; k < factors; ++k, code /= 3) {
      f[1 + k] = static_cast<double>(code % 3) - 1.0;
      f[1 + factors + k] = f[1 + k] * f[1 + k];
    }
    for (std::size_t r = 0, k = 0; r < d; ++r) {
      for (std::size_t c = 0; c <= r; ++c, ++k) information[i * packed_size(d) + k] = f[r] * f[c];
    }
  }
  return InformationSet(d, std::move(information));
}

void expect_certified(const InformationSet& set, double gap, std::uint64_t seed = 1) {
  const Solution solution = ColumnGeneration().solve(set, {.duality_gap = gap, .seed = seed});
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
  const Certificate certificate = certify(set, solution.design);
  ASSERT_EQ(certificate.status, CertificateStatus::kCertified) << certificate.message;
  EXPECT_LE(certificate.duality_gap, gap + certificate.rounding_bound + 1e-12);
}

TEST(DenseKernels, WhitenAndGramAgreeWithPlainLoops) {
  Random random(1);
  for (const std::size_t d : {1UL, 2UL, 5UL, 12UL, 19UL}) {
    const std::size_t p = packed_size(d);
    const std::size_t stride = (p + 7) / 8 * 8;
    const InformationSet set = wishart_set(d, 11, d, 0.5, d);
    std::vector<double> x(p), out(11 * stride, -1.0), traces(11), scratch(8 * d * (d + 1));
    for (double& value : x) value = random.normal();
    const std::vector<std::size_t> members = {10, 0, 3, 3, 7, 1, 2};
    dense_kernels().whiten(set.data(), members.data(), members.size(), d, x.data(), out.data(),
                           stride, traces.data(), scratch.data());
    for (std::size_t k = 0; k < members.size(); ++k) {
      double trace = 0.0;
      for (std::size_t r = 0; r < d; ++r) {
        for (std::size_t c = 0; c <= r; ++c) {
          double sum = 0.0;
          for (std::size_t a = 0; a <= r; ++a) {
            for (std::size_t b = 0; b <= c; ++b) {
              sum += x[packed_index(r, a)] * set.information(members[k])[packed_index(a, b)] *
                     x[packed_index(c, b)];
            }
          }
          trace += r == c ? sum : 0.0;
          const double factor = r == c ? 1.0 : std::sqrt(2.0);
          const double scale = 1.0 + std::abs(sum);
          EXPECT_NEAR(out[k * stride + packed_index(r, c)], factor * sum,
                      1e-11 * scale * static_cast<double>(d));
        }
      }
      EXPECT_NEAR(traces[k], trace, 1e-10 * (1.0 + std::abs(trace)));
      for (std::size_t j = p; j < stride; ++j) EXPECT_EQ(out[k * stride + j], 0.0);
    }
    const std::size_t n = members.size();
    std::vector<double> gram(n * n);
    dense_kernels().gram(out.data(), n, stride, gram.data());
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        double expected = 0.0;
        for (std::size_t k = 0; k < p; ++k) expected += out[i * stride + k] * out[j * stride + k];
        EXPECT_NEAR(gram[j * n + i], expected, 1e-11 * (1.0 + std::abs(expected)));
      }
    }
  }
}

TEST(DenseKernels, CholeskySolvesAndRefusesIndefiniteMatrices) {
  Random random(2);
  for (std::size_t n = 1; n <= 40; ++n) {
    std::vector<double> g(n * n), a(n * n, 0.0), x(n), b(n, 0.0);
    for (double& value : g) value = random.normal();
    for (double& value : x) value = random.normal();
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        for (std::size_t k = 0; k < n; ++k) a[j * n + i] += g[i * n + k] * g[j * n + k];
        a[j * n + i] += i == j ? 1.0 : 0.0;
        b[i] += a[j * n + i] * x[j];
      }
    }
    std::vector<double> factor = a;
    ASSERT_TRUE(dense_kernels().cholesky(factor.data(), n, 0.0));
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t i = 0; i < j; ++i) EXPECT_EQ(factor[j * n + i], a[j * n + i]);
      for (std::size_t i = j; i < n; ++i) {
        double product = 0.0;
        for (std::size_t k = 0; k <= j; ++k) product += factor[k * n + i] * factor[k * n + j];
        EXPECT_NEAR(product, a[j * n + i], 1e-12 * static_cast<double>(n * n));
      }
    }
    dense_kernels().cholesky_solve(factor.data(), n, b.data());
    for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(b[i], x[i], 1e-8);
    for (std::size_t k = 0; k < n; ++k) {  // whichever pivot it is
      std::vector<double> indefinite = a;
      indefinite[k * n + k] = -1.0;
      EXPECT_FALSE(dense_kernels().cholesky(indefinite.data(), n, 0.0));
    }
  }
}

TEST(DenseKernels, SubtractProductReadsTheLowerTriangleOfASymmetricMatrix) {
  Random random(4);
  for (std::size_t n = 1; n <= 40; ++n) {
    std::vector<double> a(n * n), x(n), out(n);
    for (double& value : a) value = random.normal();
    for (double& value : x) value = random.normal();
    for (double& value : out) value = random.normal();
    std::vector<double> expected = out;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        expected[i] -= a[std::min(i, j) * n + std::max(i, j)] * x[j];
      }
    }
    dense_kernels().subtract_product(a.data(), n, x.data(), out.data());
    for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(out[i], expected[i], 1e-12);
  }
}

TEST(NonnegativeQuadratic, SatisfiesTheOptimalityConditions) {
  Random random(3);
  NonnegativeQuadratic quadratic;
  for (int trial = 0; trial < 300; ++trial) {
    const std::size_t n = 1 + random.below(30);
    std::vector<double> g(n * n), a(n * n, 0.0), r(n), mu(n);
    for (double& value : g) value = random.normal();
    for (double& value : r) value = random.normal();
    for (double& value : mu) value = random.uniform() < 0.5 ? 0.0 : 1.0;
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t k = 0; k < n; ++k) a[j * n + i] += g[i * n + k] * g[j * n + k];
      }
      a[j * n + j] += 1e-3;
    }
    ASSERT_TRUE(quadratic.solve(a, r, mu));
    for (std::size_t i = 0; i < n; ++i) {
      double gradient = -r[i];
      for (std::size_t j = 0; j < n; ++j) gradient += a[j * n + i] * mu[j];
      EXPECT_GE(mu[i], 0.0);
      EXPECT_GE(gradient, -1e-8);
      EXPECT_NEAR(mu[i] * gradient, 0.0, 1e-7);
    }
  }
}

TEST(SensitivitySample, CutsAListOfAboutTheLengthWanted) {
  Random random(21);
  for (const std::size_t count : {1UL, 100UL, 1500UL, 50000UL}) {
    std::vector<double> values(count);
    for (double& value : values) value = random.uniform();
    SensitivitySample sample(values);
    for (const std::size_t wanted : {1UL, count / 10, count / 2, count, 4 * count}) {
      const double threshold = sample.exceeded_by(wanted);
      const auto longer = static_cast<double>(
          std::ranges::count_if(values, [&](double value) { return value > threshold; }));
      const auto target = static_cast<double>(std::min(wanted, count));
      // Five standard deviations of a quantile of 512 draws, and the ends of the sample.
      EXPECT_NEAR(longer, target, 0.12 * static_cast<double>(count) + 2.0)
          << count << " " << wanted;
    }
  }
}

TEST(WorkingSet, ReachesTheOptimumOfItsMembers) {
  const InformationSet set = wishart_set(6, 40, 6, 1.0, 4);
  WorkingSet working(set.dimension());
  for (std::size_t i = 0; i < 40; ++i) EXPECT_TRUE(working.add(i, set.information(i).data(), 1.0));
  EXPECT_FALSE(working.add(7, set.information(7).data(), 0.5));
  EXPECT_EQ(working.optimise(1e-11, 100), WorkingSetStatus::kConverged);
  Design design{std::vector<double>(40, 0.0)};
  for (std::size_t k = 0; k < working.size(); ++k)
    design.weights[working.indices()[k]] = working.weights()[k];
  EXPECT_LE(certify(set, design).duality_gap, 1e-10);
}

TEST(WorkingSet, MergesExactDuplicates) {
  const InformationSet set = wishart_set(3, 5, 3, 0.0, 5);
  const std::vector<std::size_t> twice = {0, 1, 2, 3, 4, 0, 1, 2, 3, 4};
  const InformationSet doubled = set.subset(twice);
  WorkingSet working(doubled.dimension());
  for (std::size_t i = 0; i < 10; ++i)
    EXPECT_EQ(working.add(i, doubled.information(i).data(), 0.1), i < 5);
  EXPECT_EQ(working.size(), 5U);
}

// Candidates of entries -1, 0 and 1 have many entries in common. They are told apart all the same,
// and a copy is found wherever it stands, after members have left, too.
TEST(WorkingSet, TellsCandidatesOfAGridApart) {
  const InformationSet set = make_family("cube3", 0, 0, 1);
  const std::size_t members = 200;
  WorkingSet working(set.dimension());
  const double weight = 1.0 / static_cast<double>(members);
  for (std::size_t i = 0; i < members; ++i) {
    EXPECT_TRUE(
        working.add(7 * i, set.information(11 * i % 2187).data(), i % 2 == 0 ? weight : 0.0));
  }
  ASSERT_TRUE(working.refresh());
  EXPECT_EQ(working.optimise(1e30, 1), WorkingSetStatus::kConverged);
  working.drop_below(1e30);
  ASSERT_EQ(working.size(), members / 2);
  for (std::size_t i = 0; i < members; ++i) {
    EXPECT_EQ(working.add(100000 + i, set.information(11 * i % 2187).data(), 0.0), i % 2 == 1) << i;
  }
}

TEST(WorkingSet, SaysWhenItsMatrixIsSingular) {
  const InformationSet set = wishart_set(4, 5, 1, 0.0, 6);
  WorkingSet working(set.dimension());
  for (std::size_t i = 0; i < 3; ++i) working.add(i, set.information(i).data(), 1.0);
  EXPECT_EQ(working.optimise(1e-8, 10), WorkingSetStatus::kSingular);
}

class ColumnGenerationFamilies : public ::testing::TestWithParam<int> {};

TEST_P(ColumnGenerationFamilies, CertifiedOnEveryShape) {
  const auto seed = static_cast<std::uint64_t>(GetParam());
  Random random(seed);
  const std::size_t d = 1 + random.below(16);
  const std::size_t rank = 1 + random.below(d);
  const std::size_t needed = (d + rank - 1) / rank;
  const std::size_t count = needed + 2 + random.below(3000);
  const double spread = 3.0 * random.uniform();
  expect_certified(wishart_set(d, count, rank, spread, seed), 1e-9, seed);
}

INSTANTIATE_TEST_SUITE_P(RandomShapes, ColumnGenerationFamilies, ::testing::Range(1, 61));

TEST(ColumnGeneration, SurvivesTiesAndDuplicates) {
  expect_certified(cube_set(4), 1e-9);
  expect_certified(cube_set(6), 1e-9);
  const InformationSet set = wishart_set(8, 300, 8, 1.0, 9);
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < 3000; ++i) indices.push_back(i % 300);
  expect_certified(set.subset(indices), 1e-9);
  const std::vector<std::size_t> same(50, 0);
  expect_certified(wishart_set(3, 1, 3, 0.0, 1).subset(same), 1e-9);
}

// Each candidate `copies` times, with entries that differ in the tenth digit.
InformationSet near_copies(const InformationSet& set, std::size_t copies, std::uint64_t seed) {
  Random random(seed);
  const std::size_t p = set.packed_size();
  AlignedArray rows(copies * set.candidate_count() * p);
  std::size_t k = 0;
  for (std::size_t copy = 0; copy < copies; ++copy) {
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      const double factor = 1.0 + 1e-9 * (2.0 * random.uniform() - 1.0);
      for (const double entry : set.information(i)) rows[k++] = factor * entry;
    }
  }
  return InformationSet(set.dimension(), std::move(rows));
}

// The optimum is that of the set itself, but for the tenth digit, and needs no more points.
TEST(ColumnGeneration, NearCopiesAreNotCollected) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const InformationSet set = wishart_set(8, 400, 1, 0.0, seed);
    const InformationSet copies = near_copies(set, 12, seed);
    const Solution one = ColumnGeneration().solve(set, {.duality_gap = 1e-9});
    const Solution many = ColumnGeneration().solve(copies, {.duality_gap = 1e-9});
    ASSERT_EQ(many.status, SolveStatus::kSolved) << many.message;
    EXPECT_EQ(many.message, "");
    const Certificate proof = certify(copies, many.design, {}, 1e-9);
    EXPECT_TRUE(proves(proof, 1e-9));
    EXPECT_NEAR(proof.log_det, certify(set, one.design).log_det, 8 * 4e-9);
    const auto points = [](const Design& design) {
      return std::ranges::count_if(design.weights, [](double weight) { return weight > 0.0; });
    };
    EXPECT_LE(points(many.design), 2 * points(one.design));
  }
}

TEST(WorkingSet, ANearCopyTakesAPlaceOnlyIfItIsWorthMore) {
  const InformationSet set = wishart_set(3, 12, 3, 0.0, 5);
  WorkingSet working(3);
  for (std::size_t i = 0; i < 12; ++i) working.add(i, set.information(i).data(), 1.0);
  ASSERT_TRUE(working.refresh());
  const auto scaled = [&](std::size_t i, double factor) {
    std::vector<double> row(set.information(i).begin(), set.information(i).end());
    for (double& entry : row) entry *= factor;
    return row;
  };
  EXPECT_FALSE(working.add(100, scaled(4, 1.0 - 1e-9).data(), 0.0));  // worth less
  EXPECT_TRUE(working.add(101, scaled(4, 1.0 + 1e-9).data(), 0.0));
  EXPECT_EQ(working.size(), 12U);
  EXPECT_EQ(working.indices()[4], 101U);
  EXPECT_NEAR(working.weights()[4], 1.0 / 12.0, 1e-15);
  EXPECT_TRUE(working.add(4, set.information(4).data(), 0.0));  // back: both are wanted
  EXPECT_EQ(working.size(), 13U);
  EXPECT_FALSE(working.add(4, set.information(4).data(), 0.0));
  EXPECT_TRUE(working.add(102, scaled(5, 1.0 + 1e-6).data(), 0.0));  // no copy
  EXPECT_EQ(working.size(), 14U);
}

TEST(ColumnGeneration, CandidatesThatInformAboutOneParameterEach) {
  // Only every thousandth candidate informs about the last parameter: a sample sees none of them.
  const std::size_t d = 5, count = 6000;
  AlignedArray information(count * packed_size(d), 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t j = i % 1000 == 17 ? d - 1 : i % (d - 1);
    information[i * packed_size(d) + packed_index(j, j)] = 1.0 + static_cast<double>(i % 7);
  }
  const InformationSet set(d, std::move(information));
  const Solution solution = ColumnGeneration().solve(set, {.duality_gap = 1e-10});
  const Certificate certificate = certify(set, solution.design);
  EXPECT_LE(certificate.duality_gap, 2e-10);
  // Equal weights 1/d on the largest candidate of each parameter.
  EXPECT_NEAR(certificate.log_det, 4 * std::log(7.0 / 5) + std::log(7.0 / 5), 1e-8);
}

TEST(ColumnGeneration, SameAnswerForEveryThreadCountAndSeedRepeats) {
  const InformationSet set = wishart_set(4, 50000, 2, 0.5, 11);
  const Solution one = ColumnGeneration().solve(set, {.duality_gap = 1e-9, .threads = 1});
  const Solution two = ColumnGeneration().solve(set, {.duality_gap = 1e-9, .threads = 2});
  EXPECT_EQ(one.design.weights, two.design.weights);
  EXPECT_EQ(one.counters.passes, two.counters.passes);
  for (const std::uint64_t seed : {1UL, 7UL}) {
    const SolveOptions options{.duality_gap = 1e-9, .seed = seed};
    const Solution first = ColumnGeneration().solve(set, options);
    const Solution again = ColumnGeneration().solve(set, options);
    EXPECT_EQ(first.design.weights, again.design.weights);
    EXPECT_EQ(first.counters.iterations, again.counters.iterations);
  }
}

TEST(ColumnGeneration, NeedsFewPassesAndHasASmallSupport) {
  for (const std::size_t rank : {1UL, 6UL, 12UL}) {
    const InformationSet set = wishart_set(12, 7920, rank, 0.0, rank);
    const Solution solution = ColumnGeneration().solve(set, {.duality_gap = 1e-9});
    EXPECT_EQ(solution.status, SolveStatus::kSolved);
    EXPECT_LE(solution.counters.passes, 6.0);
    const auto support =
        std::ranges::count_if(solution.design.weights, [](double w) { return w > 0; });
    EXPECT_LE(support, 78);
  }
}

TEST(ColumnGeneration, IllConditionedSetsAreWhitenedWhereRoundingStopsIt) {
  // Monomials up to degree 11 on [-1, 1]: M has a condition number of about 1e8.
  const std::size_t d = 12, count = 2001;
  AlignedArray information(count * packed_size(d));
  for (std::size_t i = 0; i < count; ++i) {
    const double x = -1.0 + static_cast<double>(i) / 1000.0;
    for (std::size_t r = 0, k = 0; r < d; ++r) {
      for (std::size_t c = 0; c <= r; ++c, ++k) {
        information[i * packed_size(d) + k] = std::pow(x, static_cast<double>(r + c));
      }
    }
  }
  expect_certified(InformationSet(d, std::move(information)), 1e-9);
}

// The unit roundoff is 1.1e-16: no sensitivity in double precision shows a gap of 1e-18. The design
// is as good as any all the same.
// A gap that double precision can't know: whichever way the last digits fall, the message says that
// it is rounding, and the design is as good as its digits allow.
TEST(ColumnGeneration, RoundingLimitIsAnHonestStatus) {
  for (std::uint64_t seed = 7; seed < 15; ++seed) {
    for (const InformationSet& set :
         {wishart_set(12, 500, 1, 1.0, seed), wishart_set(5, 1000, 5, 0.0, seed)}) {
      const Solution solution = ColumnGeneration().solve(set, {.duality_gap = 1e-18});
      EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure) << seed;
      EXPECT_NE(solution.message.find("rounding"), std::string::npos)
          << seed << ": " << solution.message;
      EXPECT_TRUE(proves(certify(set, solution.design, {}, 1e-9), 1e-9)) << seed;
    }
  }
}

}  // namespace
}  // namespace graybox
