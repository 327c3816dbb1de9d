#include "solvers/conditioning/normalized_set.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/interior_point/hessian_assembly.hpp"
#include "solvers/kernels/gram_kernels.hpp"

namespace graybox {
namespace {

// `rank` random factors a candidate, each candidate times 10^uniform(-decades/2, decades/2) and
// each parameter times 10^uniform(-parameter_decades/2, parameter_decades/2).
InformationSet random_set(std::size_t d, std::size_t count, std::size_t rank, double decades,
                          double parameter_decades, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> parameter(d), g(d), full(d * d);
  for (double& scale : parameter) {
    scale = std::pow(10.0, parameter_decades * random.uniform(-0.5, 0.5));
  }
  AlignedArray information(count * packed_size(d));
  for (std::size_t i = 0; i < count; ++i) {
    const double size = std::pow(10.0, decades * random.uniform(-0.5, 0.5));
    std::ranges::fill(full, 0.0);
    for (std::size_t r = 0; r < rank; ++r) {
      for (std::size_t a = 0; a < d; ++a) g[a] = parameter[a] * random.normal();
      for (std::size_t a = 0; a < d; ++a) {
        for (std::size_t b = 0; b < d; ++b) full[a * d + b] += size * g[a] * g[b];
      }
    }
    pack(full.data(), d, information.data() + i * packed_size(d));
  }
  return InformationSet(d, std::move(information));
}

TEST(NormalizedSet, MeanOfWhitenedCandidatesIsTheIdentity) {
  for (std::size_t d : {1UL, 2UL, 5UL, 12UL, 40UL}) {
    const InformationSet set = random_set(d, 3 * d + 5, 2, 3.0, 6.0, d);
    const NormalizedSet normal(set, {});
    ASSERT_TRUE(normal.regular());
    std::vector<double> mean(set.packed_size(), 0.0);
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      for (std::size_t k = 0; k < mean.size(); ++k) {
        mean[k] +=
            normal.row_norms()[i] * normal.row(i)[k] / static_cast<double>(set.candidate_count());
      }
    }
    for (std::size_t i = 0; i < d; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        EXPECT_NEAR(mean[packed_index(i, j)], i == j ? 1.0 : 0.0, 1e-9) << d;
      }
    }
  }
}

TEST(NormalizedSet, RowsHaveUnitNorm) {
  const InformationSet set = random_set(7, 40, 3, 12.0, 4.0, 3);
  const NormalizedSet normal(set, {});
  ASSERT_TRUE(normal.regular());
  for (std::size_t i = 0; i < 40; ++i) {
    double squares = 0.0;
    for (std::size_t a = 0; a < 7; ++a) {
      for (std::size_t b = 0; b < 7; ++b) squares += std::pow(normal.row(i)[packed_index(a, b)], 2);
    }
    EXPECT_NEAR(squares, 1.0, 1e-12);
  }
}

// Sensitivities do not see the change of coordinates, and log det moves by the stated shift.
TEST(NormalizedSet, KeepsSensitivitiesAndShiftsLogDet) {
  for (const double decades : {0.0, 12.0}) {
    const InformationSet set = random_set(6, 50, 6, decades, 5.0, 11);
    const NormalizedSet normal(set, {});
    ASSERT_TRUE(normal.regular());
    Random random(5);
    std::vector<double> weights(50), multipliers(50), back(50);
    double sum = 0.0;
    for (double& weight : weights) sum += weight = random.uniform();
    for (double& weight : weights) weight /= sum;
    std::vector<double> whitened(set.packed_size(), 0.0), original(set.packed_size());
    for (std::size_t i = 0; i < 50; ++i) {
      multipliers[i] = 3.0 * weights[i] * normal.row_norms()[i];
      for (std::size_t k = 0; k < whitened.size(); ++k) {
        whitened[k] += weights[i] * normal.row_norms()[i] * normal.row(i)[k];
      }
    }
    information_matrix(set, weights, original);
    InverseFactor here, there;
    ASSERT_TRUE(invert(whitened, 6, here));
    ASSERT_TRUE(invert(original, 6, there));
    EXPECT_NEAR(here.log_det + normal.log_det_shift(), there.log_det, 1e-8);
    for (std::size_t i = 0; i < 50; ++i) {
      double w = 0.0, w_original = 0.0;
      for (std::size_t k = 0; k < whitened.size(); ++k) {
        w += normal.row_norms()[i] * normal.row(i)[k] * here.trace_dual[k];
        w_original += set.information(i)[k] * there.trace_dual[k];
      }
      EXPECT_NEAR(w, w_original, 1e-8 * w_original);
    }
    normal.weights_from_multipliers(multipliers, back);
    for (std::size_t i = 0; i < 50; ++i) EXPECT_NEAR(back[i], weights[i], 1e-15);
  }
}

TEST(NormalizedSet, RefusesASingularMean) {
  const InformationSet set = random_set(5, 4, 1, 0.0, 0.0, 1);  // rank at most 4 in dimension 5
  const NormalizedSet normal(set, {});
  EXPECT_FALSE(normal.regular());
  EXPECT_FALSE(normal.message().empty());
}

TEST(NormalizedSet, LeavesTheSetAloneWhenAsked) {
  const InformationSet set = random_set(4, 9, 4, 4.0, 4.0, 2);
  const NormalizedSet normal(set, {.whiten = false, .scale_rows = false});
  ASSERT_TRUE(normal.regular());
  EXPECT_TRUE(std::equal(set.data(), set.data() + 9 * 10, normal.rows()));
  EXPECT_EQ(normal.log_det_shift(), 0.0);
}

TEST(NormalizedSet, DoesNotDependOnThreads) {
  const InformationSet set = random_set(9, 1500, 9, 6.0, 6.0, 4);
  const NormalizedSet one(set, {.threads = 1}), three(set, {.threads = 3});
  EXPECT_TRUE(std::equal(one.rows(), one.rows() + 1500 * 45, three.rows()));
}

TEST(HessianAssembly, IsTheWeightedSumOfOuterProducts) {
  for (std::size_t n : {1UL, 3UL, 6UL, 15UL, 21UL, 78UL}) {
    for (std::size_t count : {1UL, 2UL, 127UL, 128UL, 300UL}) {
      Random random(n * 1000 + count);
      std::vector<double> rows(n * count), scales(count), gram(n * n, -7.0), shared(n * n, -7.0);
      for (double& x : rows) x = random.normal();
      for (double& x : scales) x = random.normal();
      HessianAssembly(n, 1).assemble(rows.data(), count, scales, gram);
      HessianAssembly(n, 3).assemble(rows.data(), count, scales, shared);
      EXPECT_EQ(gram, shared);
      for (std::size_t a = 0; a < n; ++a) {
        for (std::size_t b = 0; b < n; ++b) {
          double expected = 0.0, magnitude = 0.0;
          for (std::size_t i = 0; i < count; ++i) {
            const double term = scales[i] * rows[i * n + a] * rows[i * n + b];
            expected += term;
            magnitude += std::abs(term);
          }
          if (b > a) {
            EXPECT_EQ(gram[a * n + b], -7.0) << "the upper triangle is not to be touched";
          } else {
            EXPECT_NEAR(gram[a * n + b], expected, 1e-13 * magnitude);
          }
        }
      }
    }
  }
}

TEST(GramKernels, CongruenceIsTheTripleProductAlsoInPlace) {
  for (std::size_t d : {1UL, 2UL, 3UL, 4UL, 5UL, 12UL, 19UL}) {
    const InformationSet set = random_set(d, 11, d, 0.0, 0.0, d);
    Random random(d);
    const std::size_t p = packed_size(d);
    std::vector<double> x(p), out(11 * p), workspace(congruence_workspace_size(d));
    for (double& value : x) value = random.normal();
    gram_kernels().congruence(set.data(), 11, d, x.data(), out.data(), workspace.data());
    std::vector<double> in_place(set.data(), set.data() + 11 * p);
    gram_kernels().congruence(in_place.data(), 11, d, x.data(), in_place.data(), workspace.data());
    EXPECT_EQ(out, in_place);
    for (std::size_t i = 0; i < 11; ++i) {
      for (std::size_t a = 0; a < d; ++a) {
        for (std::size_t b = 0; b <= a; ++b) {
          double expected = 0.0, magnitude = 0.0;
          for (std::size_t k = 0; k <= a; ++k) {
            for (std::size_t l = 0; l <= b; ++l) {
              const double term = x[packed_index(a, k)] * set.information(i)[packed_index(k, l)] *
                                  x[packed_index(b, l)];
              expected += term;
              magnitude += std::abs(term);
            }
          }
          EXPECT_NEAR(out[i * p + packed_index(a, b)], expected, 1e-13 * magnitude);
        }
      }
    }
  }
}

}  // namespace
}  // namespace graybox
