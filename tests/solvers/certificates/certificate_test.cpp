#include "solvers/certificates/certificate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "solvers/certificates/sensitivity_sieve.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox {
namespace {

InformationSet make_set(std::size_t dimension, const std::vector<double>& values) {
  AlignedArray information(values.size());
  std::ranges::copy(values, information.begin());
  return InformationSet(dimension, std::move(information));
}

InformationSet random_set(std::size_t d, std::size_t count, std::uint64_t seed) {
  Random random(seed);
  AlignedArray information(count * packed_size(d));
  std::vector<double> g(d * d), full(d * d);
  for (std::size_t i = 0; i < count; ++i) {
    for (double& x : g) x = random.normal();
    for (std::size_t r = 0; r < d; ++r) {
      for (std::size_t c = 0; c < d; ++c) {
        full[r * d + c] = 0.0;
        for (std::size_t k = 0; k < d; ++k) full[r * d + c] += g[r * d + k] * g[c * d + k];
      }
    }
    pack(full.data(), d, information.data() + i * packed_size(d));
  }
  return InformationSet(d, std::move(information));
}

TEST(Certificate, OrthogonalCandidatesAreOptimalWithEqualWeights) {
  const InformationSet set = make_set(2, {1, 0, 0, 0, 0, 4});
  const Certificate best = certify(set, {{0.5, 0.5}});
  EXPECT_EQ(best.status, CertificateStatus::kCertified);
  EXPECT_LE(std::abs(best.duality_gap), best.rounding_bound);
  EXPECT_LT(best.rounding_bound, 1e-15);
  EXPECT_NEAR(best.log_det, std::log(0.5 * 2.0), 1e-15);
  // w_1 = 1/0.25 = 4, so the gap is 4/2 - 1.
  EXPECT_NEAR(certify(set, {{0.25, 0.75}}).duality_gap, 1.0, 1e-15);
}

TEST(Certificate, RefusesWhatIsNoDesign) {
  const InformationSet set = make_set(2, {1, 0, 0, 0, 0, 4});
  EXPECT_EQ(certify(set, {{0.5}}).status, CertificateStatus::kNotADesign);
  EXPECT_EQ(certify(set, {{0.5, 0.6}}).status, CertificateStatus::kNotADesign);
  EXPECT_EQ(certify(set, {{1.1, -0.1}}).status, CertificateStatus::kNotADesign);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(certify(set, {{nan, 0.5}}).status, CertificateStatus::kNotADesign);
  EXPECT_EQ(certify(set, {{1.0, 0.0}}).status, CertificateStatus::kSingular);
  EXPECT_TRUE(std::isinf(certify(set, {{1.0, 0.0}}).duality_gap));
}

TEST(Certificate, ClipsAndRenormalisesRoundingAndSaysHowMuch) {
  const InformationSet set = make_set(2, {1, 0, 0, 0, 0, 4, 1, 0, 1});
  const Certificate certificate = certify(set, {{0.5, 0.5 + 1e-10, -1e-13}});
  EXPECT_EQ(certificate.status, CertificateStatus::kCertified);
  EXPECT_NEAR(certificate.clipped, 1e-13, 1e-20);
  EXPECT_NEAR(certificate.renormalised, 1e-10, 1e-12);
  EXPECT_EQ(certificate.support_size, 2U);
}

TEST(Certificate, RoundingBoundCoversThePlainDoublePass) {
  for (std::size_t d : {1UL, 2UL, 5UL, 12UL, 40UL}) {
    const InformationSet set = random_set(d, 60, d);
    Design design{std::vector<double>(60, 1.0 / 60)};
    const Certificate certificate = certify(set, design);
    ASSERT_EQ(certificate.status, CertificateStatus::kCertified);
    EXPECT_NEAR(certificate.duality_gap, duality_gap(set, design.weights), 1e-12);
    EXPECT_LT(certificate.rounding_bound, 1e-12);
  }
}

TEST(Certificate, InvariantUnderReparametrisationOverManyDecades) {
  const std::size_t d = 6;
  const InformationSet set = random_set(d, 30, 5);
  AlignedArray scaled(30 * packed_size(d));
  for (std::size_t i = 0; i < 30; ++i) {
    for (std::size_t r = 0; r < d; ++r) {
      for (std::size_t c = 0; c <= r; ++c) {
        const double factor =
            std::exp2(10.0 * static_cast<double>(r)) * std::exp2(10.0 * static_cast<double>(c));
        scaled[i * packed_size(d) + packed_index(r, c)] =
            factor * set.information(i)[packed_index(r, c)];
      }
    }
  }
  Design design{std::vector<double>(30, 1.0 / 30)};
  const Certificate a = certify(set, design);
  const Certificate b = certify(InformationSet(d, std::move(scaled)), design);
  EXPECT_NEAR(a.duality_gap, b.duality_gap, a.rounding_bound + b.rounding_bound);
}

// Rank-one matrices of (1, 1 + k e): the second direction is seen with e^2 = 1e-13 of the
// information.
InformationSet nearly_singular_set() {
  std::vector<double> values;
  for (int k = -2; k <= 2; ++k) {
    const double x = 1.0 + k * 3e-7;
    values.insert(values.end(), {1.0, x, x * x});
  }
  return make_set(2, values);
}

// Factors of `rank` rows, one after the other.
InformationSet factor_set(std::size_t d, std::size_t rank, const std::vector<double>& values) {
  AlignedArray factors(values.size());
  std::ranges::copy(values, factors.begin());
  return InformationSet::of_factors(d, rank, std::move(factors));
}

std::vector<double> random_numbers(std::size_t count, double scale, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> values(count);
  for (double& value : values) value = scale * random.normal();
  return values;
}

// What double precision sifts out, extended precision finds to be smaller; the certificate is as if
// nothing had been sifted.
void expect_sieve_holds(const InformationSet& set, bool sifts) {
  const std::size_t count = set.candidate_count();
  const Design design{std::vector<double>(count, 1.0 / static_cast<double>(count))};
  const CheckedWeights checked(set, design);
  const ExtendedInformation information(set, checked.weights);
  ASSERT_TRUE(information.regular());
  std::vector<double> upper(count);
  const double floor = sieve_sensitivities(set, information, upper);
  std::size_t worst = 0, left = 0;
  Extended largest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Extended sensitivity = information.sensitivity(set, i);
    if (sensitivity > largest) worst = i;
    largest = std::max(largest, sensitivity);
    left += upper[i] < floor ? 0U : 1U;
    if (std::isfinite(floor)) {
      EXPECT_LE(sensitivity, upper[i]) << i;
    }
  }
  EXPECT_LE(floor, largest);
  EXPECT_EQ(left < count / 4, sifts);
  const Certificate certificate = certify(set, design);
  EXPECT_EQ(certificate.worst_candidate, worst);
  EXPECT_EQ(certificate.duality_gap,
            static_cast<double>(largest / static_cast<Extended>(set.dimension()) - 1));
}

TEST(Certificate, WhatDoublePrecisionRulesOutChangesNothing) {
  for (const std::size_t d : {1UL, 2UL, 5UL, 12UL, 13UL}) {
    expect_sieve_holds(random_set(d, 61, d), true);
    for (const std::size_t rank : {1UL, 3UL}) {
      for (const double scale : {1.0, 1e-120, 1e120}) {
        expect_sieve_holds(factor_set(d, rank, random_numbers(61 * rank * d, scale, d)), true);
      }
      // Products of such numbers are not normal: all is left to extended precision.
      expect_sieve_holds(factor_set(d, rank, random_numbers(61 * rank * d, 1e-150, d)), false);
    }
  }
}

// All sensitivities are alike, and only extended precision tells which is called the largest.
TEST(Certificate, AmongTiesDoublePrecisionRulesNothingOut) {
  std::vector<double> circle;
  for (int k = 0; k < 1000; ++k) {
    const double angle = 2.0 * 3.14159265358979 * k / 1000;
    circle.insert(circle.end(), {std::cos(angle), std::sin(angle)});
  }
  expect_sieve_holds(factor_set(2, 1, circle), false);
  const InformationSet factors = factor_set(2, 1, circle);
  std::vector<double> matrices(factors.data(), factors.data() + 3000);
  expect_sieve_holds(make_set(2, matrices), false);
}

// Finding S1: quadruple precision takes over where 64 bits leave the verdict open.
TEST(Certificate, TheRoundingBoundIsSmallEvenWhereTheMatrixIsNearlySingular) {
  const Certificate proof = certify(nearly_singular_set(), {{0.5, 0, 0, 0, 0.5}});
  ASSERT_EQ(proof.status, CertificateStatus::kCertified);
  EXPECT_LE(proof.rounding_bound, 1e-10 + 0.1 * std::abs(proof.duality_gap));
  // The two ends are optimal for a line; that the entries are rounded moves the gap a little.
  EXPECT_LT(proof.duality_gap, 1e-2);
}

// Finding S1.
TEST(Certificate, WhatIsPromisedIncludesTheRoundingBound) {
  Certificate proof;
  proof.status = CertificateStatus::kCertified;
  proof.duality_gap = 0.0;
  proof.rounding_bound = 1e-5;
  EXPECT_FALSE(proves(proof, 1e-6));
  EXPECT_FALSE(proves(proof, 0.99e-5));
  EXPECT_TRUE(proves(proof, 1e-5));
  state_bounds(3.0, proof);
  EXPECT_DOUBLE_EQ(proof.log_det_gap, 3.0 * std::log1p(1e-5));
  EXPECT_DOUBLE_EQ(proof.efficiency, 1.0 / (1.0 + 1e-5));
}

// Finding S8.
TEST(Certificate, AGapNegativeBeyondRoundingProvesNothing) {
  Certificate proof;
  proof.status = CertificateStatus::kCertified;
  proof.duality_gap = -1e-5;
  proof.rounding_bound = 1e-6;
  EXPECT_TRUE(arithmetic_broke(proof));
  EXPECT_FALSE(proves(proof, 1.0));
}

}  // namespace
}  // namespace graybox
