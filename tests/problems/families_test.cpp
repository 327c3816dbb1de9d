#include "problems/families/families.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/families/candidate_stream.hpp"
#include "problems/families/random_families.hpp"
#include "problems/families/regression.hpp"
#include "problems/families/smooth_family.hpp"
#include "solvers/certificates/certificate.hpp"

namespace graybox {
namespace {

Eigen::MatrixXd matrix_of(const InformationSet& set, std::size_t candidate) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  Eigen::MatrixXd full(d, d);
  unpack(set.information(candidate).data(), set.dimension(), full.data());
  return full;
}

Eigen::VectorXd eigenvalues_of(const InformationSet& set, std::size_t candidate) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix_of(set, candidate)).eigenvalues();
}

// Eigenvalues above 1e-10 of the largest.
Eigen::Index rank_of(const InformationSet& set, std::size_t candidate) {
  const Eigen::VectorXd values = eigenvalues_of(set, candidate);
  return (values.array() > 1e-10 * values.maxCoeff()).count();
}

Design uniform_on(const InformationSet& set, const std::vector<std::size_t>& support) {
  Design design{std::vector<double>(set.candidate_count(), 0.0)};
  for (const std::size_t i : support) {
    design.weights[i] += 1.0 / static_cast<double>(support.size());
  }
  return design;
}

// ---- every family ------------------------------------------------------------------------------

class EveryFamily : public ::testing::TestWithParam<Family> {
 protected:
  [[nodiscard]] InformationSet make(std::size_t candidates, std::size_t dimension,
                                    std::uint64_t seed) const {
    const Family& family = GetParam();
    return family.fixed_size ? make_family(family.name)
                             : make_family(family.name, candidates, dimension, seed);
  }
};

TEST_P(EveryFamily, IsAProblem) {
  const InformationSet set = make(200, 12, 1);
  EXPECT_NO_THROW(set.validate());
  EXPECT_EQ(set.name(), GetParam().name);
}

TEST_P(EveryFamily, HasAnyDimension) {
  if (GetParam().fixed_size) return;
  const bool limited = GetParam().name == "monomials" || GetParam().name == "exponentials";
  if (limited) {
    EXPECT_THROW(make(200, 40, 1), InputError);
  }
  for (const std::size_t d : {1U, 2U, 7U, limited ? 8U : 40U}) {
    const InformationSet set = make(200, d, 1);
    EXPECT_EQ(set.dimension(), d);
    EXPECT_EQ(set.candidate_count(), 200U);
    EXPECT_NO_THROW(set.validate());
  }
}

TEST_P(EveryFamily, FollowsTheSeedAlone) {
  const InformationSet set = make(100, 5, 7);
  EXPECT_EQ(set.content_hash(), make(100, 5, 7).content_hash());
  if (GetParam().fixed_size) return;
  if (!GetParam().random) {
    EXPECT_EQ(set.content_hash(), make(100, 5, 8).content_hash());
    return;
  }
  EXPECT_NE(set.content_hash(), make(100, 5, 8).content_hash());
}

TEST_P(EveryFamily, IsNestedInItsSize) {
  if (GetParam().fixed_size || !GetParam().random || GetParam().name == "dup") return;
  const InformationSet small = make(30, 6, 2);
  const InformationSet large = make(300, 6, 2);
  EXPECT_TRUE(std::equal(small.data(), small.data() + 30 * small.packed_size(), large.data()));
}

INSTANTIATE_TEST_SUITE_P(ByName, EveryFamily, ::testing::ValuesIn(families()),
                         [](const auto& tested) { return tested.param.name; });

TEST(Families, UnknownNamesListTheKnown) {
  try {
    static_cast<void>(make_family("nonsense"));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("rob, wis, flat, smo"), std::string::npos);
  }
  EXPECT_THROW(make_family("cube3", 100), InputError);
  EXPECT_THROW(make_family("dup", 101), InputError);
}

// ---- their own properties ----------------------------------------------------------------------

TEST(CandidateStream, GammaVariatesHaveTheirMoments) {
  for (const double shape : {1.0, 1.5, 6.0, 100.0}) {
    constexpr int kDraws = 40000;
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < kDraws; ++i) {
      Random random = candidate_stream(11, static_cast<std::size_t>(i));
      const double x = gamma_variate(random, shape);
      sum += x;
      squares += (x - shape) * (x - shape);
    }
    // Mean and variance are both `shape`; five standard errors (fourth central moment 3 a^2 + 6 a).
    EXPECT_NEAR(sum / kDraws, shape, 5.0 * std::sqrt(shape / kDraws));
    EXPECT_NEAR(squares / kDraws, shape,
                5.0 * std::sqrt((2.0 * shape * shape + 6.0 * shape) / kDraws));
  }
}

TEST(Wishart, HasTheMomentsOfGG) {
  // With n degrees of freedom and W = G G'/n: E W = I, var W_jk = (1 + [j = k]) / n.
  constexpr std::size_t kCandidates = 20000;
  constexpr std::size_t kDimension = 4;
  for (const std::size_t degrees : {4U, 30U}) {
    const InformationSet set =
        wishart_family(kCandidates, kDimension, degrees, ScaleDistribution::kNone, 5);
    for (std::size_t j = 0; j < kDimension; ++j) {
      for (std::size_t k = 0; k <= j; ++k) {
        const double expected = j == k ? 1.0 : 0.0;
        const double variance = (j == k ? 2.0 : 1.0) / static_cast<double>(degrees);
        double sum = 0.0, squares = 0.0;
        for (std::size_t i = 0; i < kCandidates; ++i) {
          const double x = set.information(i)[packed_index(j, k)] - expected;
          sum += x;
          squares += x * x;
        }
        EXPECT_NEAR(sum / kCandidates, 0.0, 5.0 * std::sqrt(variance / kCandidates));
        EXPECT_NEAR(squares / kCandidates / variance, 1.0, 0.15);
      }
    }
  }
  EXPECT_THROW(wishart_family(10, 4, 3, ScaleDistribution::kNone, 1), InputError);
}

TEST(Wishart, LogNormalScalesGiveOutliers) {
  // The diagonal of rob is exp(2 z) times a chi-squared variate over d: its logarithm spreads by
  // at least the 2 of the scale, that of wis far less.
  const auto spread = [](const InformationSet& set) {
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      const double x = std::log(set.information(i)[0]);
      sum += x;
      squares += x * x;
    }
    const auto n = static_cast<double>(set.candidate_count());
    return std::sqrt(squares / n - sum * sum / (n * n));
  };
  EXPECT_NEAR(spread(make_family("rob", 5000)), 2.0, 0.2);
  EXPECT_LT(spread(make_family("wis", 5000)), 0.6);
  EXPECT_LT(spread(make_family("flat", 5000)), 0.15);
}

TEST(Decades, DiagonalsSpreadOverTwelveDecades) {
  const InformationSet set = make_family("decades", 2000);
  double smallest = 1e300, largest = 0.0;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    for (std::size_t j = 0; j < 12; ++j) {
      smallest = std::min(smallest, set.information(i)[packed_index(j, j)]);
      largest = std::max(largest, set.information(i)[packed_index(j, j)]);
    }
  }
  EXPECT_NEAR(std::log10(largest / smallest), 12.0, 1.5);
}

TEST(RankOne, HasRankOne) {
  for (const char* name : {"r1g", "r1l"}) {
    const InformationSet set = make_family(name, 50);
    for (std::size_t i = 0; i < 50; ++i) EXPECT_EQ(rank_of(set, i), 1) << name << " " << i;
  }
}

TEST(Duplicated, EveryMatrixStandsThereTenTimes) {
  const InformationSet set = make_family("dup", 500, 4, 9);
  const InformationSet original = make_family("rob", 50, 4, 9);
  for (std::size_t i = 0; i < 500; ++i) {
    EXPECT_TRUE(std::ranges::equal(set.information(i), original.information(i % 50)));
  }
}

TEST(Smooth, RankAndScale) {
  const InformationSet six = make_family("smr6", 40);
  for (std::size_t i = 0; i < 40; ++i) EXPECT_EQ(rank_of(six, i), 6);
  // smo is the unscaled manifold of full rank under S = diag(10^(-5 j / 11)).
  const InformationSet scaled = make_family("smo", 40, 12, 4);
  const InformationSet plain = smooth_family(40, 12, 12, 0.0, 4);
  for (std::size_t i = 0; i < 40; ++i) {
    for (std::size_t j = 0; j < 12; ++j) {
      const double factor = std::pow(10.0, -10.0 * static_cast<double>(j) / 11.0);
      const double expected = plain.information(i)[packed_index(j, j)] * factor;
      EXPECT_NEAR(scaled.information(i)[packed_index(j, j)], expected, 1e-12 * expected);
    }
  }
}

// Mean over a few candidates of |H_i - H_j| / |H_i|, j the nearest to i by angles among the first
// `count`.
double nearest_change(const InformationSet& set, std::size_t count) {
  const auto distance = [&](std::size_t i, std::size_t j) {
    double sum = 0.0;
    for (std::size_t k = 0; k < 4; ++k) {
      sum += std::pow(set.coordinates(i)[k] - set.coordinates(j)[k], 2);
    }
    return sum;
  };
  constexpr std::size_t kTried = 100;
  double sum = 0.0;
  for (std::size_t i = 0; i < kTried; ++i) {
    std::size_t nearest = i == 0 ? 1 : 0;
    for (std::size_t j = 0; j < count; ++j) {
      if (j != i && distance(i, j) < distance(i, nearest)) nearest = j;
    }
    sum += (matrix_of(set, i) - matrix_of(set, nearest)).norm() / matrix_of(set, i).norm();
  }
  return sum / kTried;
}

TEST(Smooth, NeighboursAreNearlyEqualAndAnglesFillTheBox) {
  // The manifold is smooth: 16 times as many candidates in four dimensions stand twice as close, so
  // that the change to the nearest neighbour halves.
  const InformationSet set = make_family("smo", 8000, 6);
  EXPECT_NEAR(nearest_change(set, 8000) / nearest_change(set, 500), 0.5, 0.15);
  for (std::size_t k = 0; k < 4; ++k) {
    std::vector<std::size_t> counts(8, 0);
    for (std::size_t i = 0; i < 8000; ++i) {
      const double angle = set.coordinates(i)[k];
      ASSERT_LE(std::abs(angle), std::numbers::pi / 2.0);
      ++counts[static_cast<std::size_t>((angle / std::numbers::pi + 0.5) * 7.999999)];
    }
    for (const std::size_t count : counts) EXPECT_NEAR(static_cast<double>(count), 1000.0, 40.0);
  }
}

// ---- closed-form optima ------------------------------------------------------------------------

TEST(Polynomial, EqualWeightsAtTheLegendreRootsAreOptimal) {
  for (std::size_t degree = 1; degree <= 11; ++degree) {
    std::vector<double> points = optimal_polynomial_points(degree);
    ASSERT_TRUE(std::ranges::is_sorted(points));
    const std::size_t optimal = points.size();
    for (const double x : even_points(201)) points.push_back(x);
    for (const auto basis :
         {PolynomialBasis::kMonomial, PolynomialBasis::kLegendre, PolynomialBasis::kChebyshev}) {
      const InformationSet set = polynomial_regression(degree, points, basis);
      std::vector<std::size_t> support(optimal);
      for (std::size_t i = 0; i < optimal; ++i) support[i] = i;
      const Certificate certificate = certify(set, uniform_on(set, support));
      ASSERT_EQ(certificate.status, CertificateStatus::kCertified);
      EXPECT_LE(certificate.duality_gap, 1e-12 + certificate.rounding_bound) << degree;
    }
  }
}

TEST(Polynomial, NeedsEnoughDistinctPoints) {
  const std::vector<double> points{0.0, 1.0, 1.0};
  EXPECT_THROW(polynomial_regression(2, points, PolynomialBasis::kMonomial), InputError);
  EXPECT_THROW(even_points(1), InputError);
  EXPECT_THROW(optimal_polynomial_points(0), InputError);
}

TEST(Factorial, TheUniformDesignIsOptimalWithUnitInformation) {
  for (const std::size_t interactions : {1U, 2U}) {
    const InformationSet set = two_level_factorial(5, interactions);
    EXPECT_EQ(set.candidate_count(), 32U);
    EXPECT_EQ(set.dimension(), interactions == 1 ? 6U : 16U);
    std::vector<std::size_t> all(32);
    for (std::size_t i = 0; i < 32; ++i) all[i] = i;
    const Certificate certificate = certify(set, uniform_on(set, all));
    EXPECT_LE(certificate.duality_gap, certificate.rounding_bound);
    EXPECT_NEAR(certificate.log_det, 0.0, 1e-14);
  }
  EXPECT_THROW(two_level_factorial(0, 1), InputError);
  EXPECT_THROW(two_level_factorial(3, 3), InputError);
}

TEST(Cube, TheProductDesignIsOptimalAndNotUnique) {
  for (const std::size_t levels : {3U, 5U}) {
    const InformationSet set = cube_regression(levels);
    EXPECT_EQ(set.candidate_count(), levels == 3 ? 2187U : 78125U);
    std::vector<std::size_t> full, half;
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      const auto x = set.coordinates(i);
      const bool quadratic = std::ranges::all_of(
          x.first(4), [](double v) { return v == -1.0 || v == 0.0 || v == 1.0; });
      const bool linear =
          std::ranges::all_of(x.last(3), [](double v) { return std::abs(v) == 1.0; });
      if (!quadratic || !linear) continue;
      full.push_back(i);
      if (x[4] * x[5] * x[6] == 1.0) half.push_back(i);  // a half fraction is optimal as well
    }
    EXPECT_EQ(full.size(), 648U);
    EXPECT_EQ(half.size(), 324U);
    const double optimum = 4.0 * (std::log(2.0 / 3.0) + std::log(2.0 / 9.0));
    for (const auto& support : {full, half}) {
      const Certificate certificate = certify(set, uniform_on(set, support));
      EXPECT_LE(certificate.duality_gap, certificate.rounding_bound + 1e-15);
      EXPECT_NEAR(certificate.log_det, optimum, 1e-13);
    }
  }
  EXPECT_THROW(cube_regression(4), InputError);
}

}  // namespace
}  // namespace graybox
