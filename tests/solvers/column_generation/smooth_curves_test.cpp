// Regression on smooth curves: the candidates that are next to each other are nearly equal, the
// optimal support are a few points, and the information matrices of unlucky bases are as
// ill-conditioned as one likes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/families/families.hpp"
#include "problems/families/regression.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "tests/support/true_gap.hpp"

namespace graybox {
namespace {

constexpr double kGap = 1e-9;

// ---- known optima ------------------------------------------------------------------------------

// Weight by place, neighbours joined: (mean place, weight).
std::vector<std::pair<double, double>> clusters(const InformationSet& set, const Design& design,
                                                double distance) {
  std::vector<std::pair<double, double>> found;
  double last = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const double weight = design.weights[i];
    if (weight <= 0.0) continue;
    const double x = set.coordinates(i)[0];
    if (x - last > distance) found.emplace_back(0.0, 0.0);
    found.back().first += weight * x;
    found.back().second += weight;
    last = x;
  }
  for (auto& [place, weight] : found) place /= weight;
  return found;
}

TEST(SmoothCurves, PolynomialDesignsStandAtTheRootsWhateverTheBasis) {
  constexpr std::size_t kPoints = 4001;
  constexpr double kStep = 2.0 / (kPoints - 1);
  const auto points = even_points(kPoints);
  for (const std::size_t degree : {3U, 7U, 11U, 15U, 30U}) {
    const std::vector<double> roots = optimal_polynomial_points(degree);
    for (const auto basis :
         {PolynomialBasis::kLegendre, PolynomialBasis::kChebyshev, PolynomialBasis::kMonomial}) {
      if (basis == PolynomialBasis::kMonomial && degree > 15) continue;
      const InformationSet set = polynomial_regression(degree, points, basis);
      const Solution solution = ColumnGeneration().solve(set, {.duality_gap = kGap});
      ASSERT_EQ(solution.status, SolveStatus::kSolved) << degree << " " << solution.message;
      EXPECT_LE(true_gap(set, solution.design), kGap);
      const auto found = clusters(set, solution.design, 1.5 * kStep);
      ASSERT_EQ(found.size(), degree + 1);
      for (std::size_t k = 0; k <= degree; ++k) {
        EXPECT_NEAR(found[k].first, roots[k], kStep) << degree;
        EXPECT_NEAR(found[k].second, 1.0 / static_cast<double>(degree + 1), 1e-3) << degree;
      }
    }
  }
}

TEST(SmoothCurves, ADesignIsWorthTheSameInEveryBasis) {
  const auto points = even_points(501);
  const InformationSet legendre = polynomial_regression(12, points, PolynomialBasis::kLegendre);
  for (const auto basis : {PolynomialBasis::kMonomial, PolynomialBasis::kChebyshev}) {
    const InformationSet other = polynomial_regression(12, points, basis);
    const Solution solution = ColumnGeneration().solve(other, {.duality_gap = kGap});
    ASSERT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    // The rounding of the regressors of the monomials themselves stands in the way of more.
    EXPECT_LE(certify(legendre, solution.design).duality_gap, 1e-8);
  }
}

TEST(SmoothCurves, AreSolvedOnGridsOfAThousandToAHundredThousand) {
  const std::vector<std::pair<std::string, std::size_t>> curves{
      {"legendre", 12}, {"legendre", 31}, {"chebyshev", 20},  {"monomials", 12},
      {"splines", 12},  {"splines", 31},  {"exponentials", 8}};
  for (const auto& [name, dimension] : curves) {
    for (const std::size_t count : {1000U, 10000U, 100000U}) {
      const InformationSet set = make_family(name, count, dimension);
      const Solution solution = ColumnGeneration().solve(set, {.duality_gap = kGap});
      EXPECT_EQ(solution.status, SolveStatus::kSolved)
          << name << " " << count << ": " << solution.message;
      EXPECT_TRUE(solution.message.empty()) << name << " " << count << ": " << solution.message;
      EXPECT_TRUE(proves(certify(set, solution.design, {}, kGap), kGap)) << name << " " << count;
      // In own coordinates or whitened: at most a few dozen passes, not hundreds.
      EXPECT_LE(solution.counters.passes, 60.0) << name << " " << count;
    }
  }
}

TEST(SmoothCurves, BasesBeyondDoublePrecisionAreRefusedWithTheBasisToUse) {
  const auto refusal = [](const std::function<void()>& make) -> std::string {
    try {
      make();
    } catch (const InputError& error) {
      return error.what();
    }
    return {};
  };
  const auto points = even_points(2001);
  const std::string monomials =
      refusal([&] { (void)polynomial_regression(25, points, PolynomialBasis::kMonomial); });
  EXPECT_NE(monomials.find("legendre or chebyshev"), std::string::npos) << monomials;
  EXPECT_NE(refusal([&] { (void)exponential_regression(25, points); }).find("orthogonal basis"),
            std::string::npos);
  EXPECT_EQ(refusal([&] {
              (void)polynomial_regression(30, points, PolynomialBasis::kLegendre).validate();
              (void)polynomial_regression(30, points, PolynomialBasis::kChebyshev).validate();
              (void)polynomial_regression(14, points, PolynomialBasis::kMonomial).validate();
              (void)spline_regression(40, points).validate();
              (void)exponential_regression(8, points).validate();
            }),
            "");
}

TEST(SmoothCurves, SplinesAreAPartitionOfUnityWithLocalSupport) {
  for (const std::size_t d : {1U, 2U, 3U, 4U, 9U, 31U}) {
    const InformationSet set = spline_regression(d, even_points(301));
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      // With H = f f^T the sum of all entries is the square of that of f.
      double sum = 0.0;
      std::size_t positive = 0;
      for (std::size_t j = 0; j < d; ++j) {
        for (std::size_t k = 0; k < d; ++k) {
          const double value = set.information(i)[packed_index(j, k)];
          EXPECT_GE(value, 0.0);
          sum += value;
          positive += j == k && value > 0.0 ? 1U : 0U;
        }
      }
      EXPECT_NEAR(sum, 1.0, 1e-13);
      EXPECT_LE(positive, 4U);
    }
  }
}

// ---- hostile curves ----------------------------------------------------------------------------

// The same problem with each parameter in a unit of its own, up to eight decades apart.
InformationSet in_random_units(const InformationSet& set, Random& random) {
  const std::size_t d = set.dimension(), p = set.packed_size();
  std::vector<double> unit(d);
  for (double& u : unit) u = std::pow(10.0, 8.0 * random.uniform() - 4.0);
  AlignedArray information(set.candidate_count() * p);
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    for (std::size_t a = 0; a < d; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        const std::size_t k = packed_index(a, b);
        information[i * p + k] = unit[a] * unit[b] * set.information(i)[k];
      }
    }
  }
  return InformationSet(d, std::move(information));
}

// A curve x -> f(x) of a random kind, on random points, in random units.
InformationSet hostile_curve(std::uint64_t seed) {
  Random random(seed);
  const std::size_t kind = seed % 7;
  std::size_t d = 2 + random.below(kind == 2 ? 13 : kind == 4 ? 7 : 19);
  const std::size_t count = 4 * d + random.below(seed % 5 == 0 ? 20000 : 3000);
  std::vector<double> points = even_points(count);
  const std::size_t grid = random.below(4);
  for (double& x : points) {
    if (grid == 1) x = std::sin(0.5 * std::numbers::pi * x);                  // dense at the ends
    if (grid == 2) x = x * std::abs(x);                                       // dense in the middle
    if (grid == 3) x += 0.3 / static_cast<double>(count) * random.uniform();  // uneven
    x = std::clamp(x, -1.0, 1.0);
  }
  const double width = 1.0 + 0.6 * random.uniform(), shift = random.uniform();
  const auto gaussians = [&](double x, std::size_t k) {
    const double step = 2.0 / static_cast<double>(d);
    const double z = (x + 1.0 - (static_cast<double>(k) + shift) * step) / (width * step);
    return std::exp(-0.5 * z * z);
  };
  const auto waves = [&](double x, std::size_t k) {
    const double turn = std::numbers::pi * (0.7 + 0.3 * shift) * static_cast<double>((k + 1) / 2);
    return k % 2 == 0 ? std::cos(turn * x) : std::sin(turn * x);
  };
  const InformationSet set = [&] {
    switch (kind) {
      case 0:
        return polynomial_regression(d - 1, points, PolynomialBasis::kLegendre);
      case 1:
        return polynomial_regression(d - 1, points, PolynomialBasis::kChebyshev);
      case 2:
        return polynomial_regression(d - 1, points, PolynomialBasis::kMonomial);
      case 3:
        return spline_regression(d, points);
      case 4:
        return exponential_regression(d, points);
      default:
        break;
    }
    AlignedArray information(count * packed_size(d));
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t a = 0, k = 0; a < d; ++a) {
        for (std::size_t b = 0; b <= a; ++b, ++k) {
          information[i * packed_size(d) + k] =
              kind == 5 ? gaussians(points[i], a) * gaussians(points[i], b)
                        : waves(points[i], a) * waves(points[i], b);
        }
      }
    }
    return InformationSet(d, std::move(information));
  }();
  return seed % 3 == 0 ? in_random_units(set, random) : set;
}

class HostileCurves : public ::testing::TestWithParam<std::uint64_t> {};

// 230 of them. Before the well-conditioned start 14 of 230 such curves ended with a singular
// design.
TEST_P(HostileCurves, EveryOneIsSolvedAndTheClaimIsTrue) {
  for (std::uint64_t seed = 10 * GetParam(); seed < 10 * GetParam() + 10; ++seed) {
    const InformationSet set = hostile_curve(seed);
    ASSERT_NO_THROW(set.validate()) << seed;
    const Solution solution = ColumnGeneration().solve(set, {.duality_gap = kGap, .seed = seed});
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << seed << ": " << solution.message;
    EXPECT_LE(true_gap(set, solution.design), kGap)
        << seed << ", d = " << set.dimension() << ", Q = " << set.candidate_count();
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, HostileCurves, ::testing::Range<std::uint64_t>(0, 23));

// Neighbours on this grid differ by 1e-5 and less. Weight has to move between them; with a proximal
// term that does not shrink it crept, and another back-end had to finish after 200 passes.
TEST(SmoothCurves, FineGridsNeedNoFallback) {
  const InformationSet set =
      polynomial_regression(11, even_points(300000), PolynomialBasis::kLegendre);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Solution solution = ColumnGeneration().solve(set, {.duality_gap = kGap, .seed = seed});
    ASSERT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    EXPECT_EQ(solution.message, "");
    EXPECT_LT(solution.counters.passes, 8.0);
    EXPECT_TRUE(proves(certify(set, solution.design, {}, kGap), kGap));
  }
}

}  // namespace
}  // namespace graybox
