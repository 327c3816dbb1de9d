// Certificates of A, E, L and Ds: known optima have gap zero, no design is better than its
// certificate allows, and nothing that is handed in makes a certificate claim too much.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "solvers/certificates/certificate.hpp"
#include "tests/support/criterion_sets.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<Criterion> criteria_for(Eigen::Index d, Random& random) {
  const MatrixXd g = gaussian(d, d, random);
  const VectorXd c = gaussian(d, 1, random);
  std::vector<std::size_t> all(static_cast<std::size_t>(d));
  std::iota(all.begin(), all.end(), std::size_t{0});
  return {Criterion(),
          Criterion::a(),
          Criterion::e(),
          Criterion::l(packed(MatrixXd(g * g.transpose()))),
          Criterion::l(packed(MatrixXd(c * c.transpose()))),
          Criterion::ds({0}),
          Criterion::ds({static_cast<std::size_t>(d) - 1, 0}),
          Criterion::ds(all)};
}

std::vector<double> random_weights(std::size_t count, Random& random) {
  std::vector<double> weights(count);
  double sum = 0.0;
  for (double& w : weights) sum += w = -std::log(1.0 - random.uniform());
  for (double& w : weights) w /= sum;
  return weights;
}

TEST(CriterionCertificate, KnownOptimaHaveNoGap) {
  for (const KnownOptimum& known : known_optima()) {
    SCOPED_TRACE(known.name);
    Design design{known.weights};
    if (std::string(known.name) == "E, orthogonal") {
      // A d-fold smallest eigenvalue: the dual matrix is diagonal with E_ii s_i equal.
      design.dual_matrix.assign(known.set.packed_size(), 0.0);
      for (std::size_t i = 0; i < known.weights.size(); ++i) {
        design.dual_matrix[packed_index(i, i)] = known.weights[i];
      }
    }
    const Certificate proof = certify(known.set, design, known.criterion);
    ASSERT_EQ(proof.status, CertificateStatus::kCertified);
    EXPECT_LE(std::abs(proof.duality_gap), 1e-13 + proof.rounding_bound);
    EXPECT_LE(proof.rounding_bound, 1e-13);
    EXPECT_NEAR(goodness(information_of(known.set, known.weights), known.criterion), known.goodness,
                1e-10 * known.goodness);
  }
}

TEST(CriterionCertificate, ReportsTheCriterionsValue) {
  Random random(3);
  const InformationSet set = wishart(4, 30, 2, 5);
  const std::vector<double> weights = random_weights(30, random);
  const MatrixXd m = information_of(set, weights);
  for (const Criterion& criterion : criteria_for(4, random)) {
    const Certificate proof = certify(set, {weights}, criterion);
    const double phi = goodness(m, criterion);
    double expected = 1.0 / phi;
    if (criterion.kind() == CriterionKind::kE) expected = phi;
    if (criterion.kind() == CriterionKind::kD) expected = 4.0 * std::log(phi);
    if (criterion.kind() == CriterionKind::kDs) {
      expected = static_cast<double>(criterion.interest().size()) * std::log(phi);
    }
    EXPECT_NEAR(proof.criterion_value, expected, 1e-10 * std::abs(expected));
    EXPECT_NEAR(proof.log_det, std::log(m.determinant()), 1e-10);
    EXPECT_EQ(proof.efficiency, 1.0 / (1.0 + largest_gap(proof)));
  }
}

// The gap is max tr(G H_i) - 1 with G the gradient of log Phi: central differences.
TEST(CriterionCertificate, SensitivitiesAreTheGradientOfTheLogarithm) {
  Random random(8);
  const InformationSet set = wishart(5, 20, 2, 9);
  const std::vector<double> weights = random_weights(20, random);
  const MatrixXd m = information_of(set, weights);
  for (const Criterion& criterion : criteria_for(5, random)) {
    double largest = 0.0;
    for (std::size_t i = 0; i < 20; ++i) {
      const double step = 1e-4;
      const MatrixXd h = step * matrix_of(set, i);
      largest = std::max(
          largest, (std::log(goodness(m + h, criterion)) - std::log(goodness(m - h, criterion))) /
                       (2.0 * step));
    }
    // E: as long as the smallest eigenvalue is simple, its eigenvector is the supergradient.
    const Certificate proof = certify(set, {weights}, criterion);
    if (criterion.kind() != CriterionKind::kE) {
      EXPECT_NEAR(proof.duality_gap, largest - 1.0, 1e-5 * largest) << to_string(criterion.kind());
    } else {
      EXPECT_LE(proof.duality_gap, (largest - 1.0) + 1e-5 * largest);
    }
  }
}

// Two and three candidates: all designs on a grid. None may beat what any certificate allows.
TEST(CriterionCertificate, NoDesignIsBetterThanACertificateAllows) {
  Random random(21);
  for (int round = 0; round < 12; ++round) {
    const std::size_t count = 2 + static_cast<std::size_t>(round % 2);
    const InformationSet set = wishart(2 + round % 3, count, 2, 100 + static_cast<unsigned>(round));
    std::vector<std::vector<double>> grid;
    const int steps = count == 2 ? 200 : 24;
    for (int a = 0; a <= steps; ++a) {
      for (int b = 0; b <= (count == 2 ? 0 : steps - a); ++b) {
        std::vector<double> weights{static_cast<double>(a) / steps,
                                    static_cast<double>(steps - a - b) / steps};
        if (count == 3) weights.push_back(static_cast<double>(b) / steps);
        grid.push_back(std::move(weights));
      }
    }
    for (const Criterion& criterion :
         criteria_for(static_cast<Eigen::Index>(set.dimension()), random)) {
      double best = 0.0, lowest_bound = std::numeric_limits<double>::infinity();
      for (const auto& weights : grid) {
        const double phi = goodness(information_of(set, weights), criterion);
        if (phi == 0.0) continue;
        best = std::max(best, phi);
        const Certificate proof = certify(set, {weights}, criterion);
        if (proof.status != CertificateStatus::kCertified) continue;
        lowest_bound = std::min(lowest_bound, phi * (1.0 + proof.duality_gap));
      }
      EXPECT_LE(best, lowest_bound * (1.0 + 1e-9)) << to_string(criterion.kind());
      EXPECT_GT(best, 0.0);
    }
  }
}

TEST(CriterionCertificate, AllParametersOfInterestIsD) {
  Random random(4);
  const InformationSet set = wishart(6, 40, 3, 2, 2.0);
  const Design design{random_weights(40, random)};
  const Certificate d = certify(set, design);
  const Certificate ds = certify(set, design, Criterion::ds({3, 1, 0, 2, 5, 4}));
  EXPECT_NEAR(ds.duality_gap, d.duality_gap, 1e-13 * (1.0 + d.duality_gap));
  EXPECT_NEAR(ds.criterion_value, d.log_det, 1e-13);
  EXPECT_NEAR(ds.log_det_gap, d.log_det_gap, 1e-13);
}

TEST(CriterionCertificate, IdentityWeightsAreA) {
  Random random(4);
  const InformationSet set = wishart(6, 40, 3, 2, 2.0);
  const Design design{random_weights(40, random)};
  const Certificate a = certify(set, design, Criterion::a());
  const Certificate l = certify(set, design, Criterion::l(packed(MatrixXd::Identity(6, 6))));
  EXPECT_DOUBLE_EQ(a.duality_gap, l.duality_gap);
  EXPECT_DOUBLE_EQ(a.criterion_value, l.criterion_value);
}

// theta' = T^-T theta has H' = T H T^T. A and E bear rotations, L any T with W' = T W T^T, Ds any
// change of the nuisance parameters.
TEST(CriterionCertificate, FollowsTheParameters) {
  Random random(6);
  const Eigen::Index d = 5;
  const InformationSet set = wishart(d, 40, 2, 3, 1.0);
  const Design design{random_weights(40, random)};
  const MatrixXd rotation = Eigen::HouseholderQR<MatrixXd>(gaussian(d, d, random)).householderQ() *
                            MatrixXd::Identity(d, d);
  const MatrixXd t = gaussian(d, d, random) + 2.0 * MatrixXd::Identity(d, d);
  MatrixXd covariance_map = t;  // T^-T, which leaves parameters 0 and 1 what they are
  covariance_map.topRows(2).setIdentity();
  const MatrixXd g = gaussian(d, 2, random);
  const MatrixXd w = g * g.transpose();

  const auto expect_same = [&](const MatrixXd& map, const Criterion& before,
                               const Criterion& after) {
    const Certificate here = certify(set, design, before);
    const Certificate there = certify(transformed(set, map), design, after);
    EXPECT_NEAR(here.duality_gap, there.duality_gap, 1e-9 * (1.0 + here.duality_gap));
  };
  expect_same(rotation, Criterion::a(), Criterion::a());
  expect_same(rotation, Criterion::e(), Criterion::e());
  const MatrixXd mapped = t * w * t.transpose();
  expect_same(t, Criterion::l(packed(w)),
              Criterion::l(packed(MatrixXd(0.5 * (mapped + mapped.transpose())))));
  expect_same(covariance_map.inverse().transpose(), Criterion::ds({0, 1}), Criterion::ds({0, 1}));
  // Units: none matter for Ds.
  const MatrixXd units = VectorXd::LinSpaced(d, 0.1, 100.0).asDiagonal();
  expect_same(units, Criterion::ds({1, 3}), Criterion::ds({1, 3}));
}

TEST(CriterionCertificate, ScalingPermutationAndDuplicatesChangeNoGap) {
  Random random(12);
  const Eigen::Index d = 4;
  const InformationSet set = wishart(d, 25, 2, 31);
  const std::vector<double> weights = random_weights(25, random);
  std::vector<MatrixXd> scaled = matrices_of(set);
  for (MatrixXd& h : scaled) h *= 1e5;
  std::vector<std::size_t> reversed(25);
  std::iota(reversed.rbegin(), reversed.rend(), std::size_t{0});
  std::vector<double> halves(weights);
  halves.insert(halves.end(), weights.begin(), weights.end());
  for (double& w : halves) w *= 0.5;
  for (const Criterion& criterion : criteria_for(d, random)) {
    SCOPED_TRACE(to_string(criterion.kind()));
    const double gap = certify(set, {weights}, criterion).duality_gap;
    EXPECT_NEAR(certify(from_matrices(scaled), {weights}, criterion).duality_gap, gap, 1e-10);
    const std::vector<double> backwards(weights.rbegin(), weights.rend());
    EXPECT_NEAR(certify(set.subset(reversed), {backwards}, criterion).duality_gap, gap, 1e-10);
    EXPECT_NEAR(certify(concatenated(set, set), {halves}, criterion).duality_gap, gap, 1e-10);
  }
}

// Whatever dual matrix comes with a design, the efficiency certified is not above the true one.
TEST(CriterionCertificate, AWrongDualMatrixCanOnlyLoosenTheBound) {
  Random random(77);
  const InformationSet set = orthogonal({1.0, 2.0, 4.0});
  const double best = 1.0 / (1.0 + 0.5 + 0.25);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> weights{0.5, 0.3, 0.2};
  const double efficiency = 0.5 / best;
  std::vector<std::vector<double>> duals{{},
                                         {1.0},
                                         {nan, 0, 0, 0, 0, 0},
                                         {0, 0, 0, 0, 0, 0},
                                         {-1, 0, -1, 0, 0, -1},
                                         {1e-300, 0, 0, 0, 0, 0},
                                         {1e300, 1e300, 1e300, 1e300, 1e300, 1e300},
                                         {-5, 0, 1, 0, 0, 0},
                                         {0, 1, 0, 1, 1, 0}};
  for (int k = 0; k < 200; ++k) {
    std::vector<double> dual(6);
    for (double& x : dual) x = std::pow(10.0, 3.0 * random.normal()) * random.normal();
    duals.push_back(dual);
  }
  for (const auto& dual : duals) {
    const Certificate proof = certify(set, {weights, dual}, Criterion::e());
    ASSERT_EQ(proof.status, CertificateStatus::kCertified);
    EXPECT_LE(proof.efficiency, efficiency + 1e-12);
  }
  // The right one, scaled and with a spurious negative eigenvalue, is repaired and then exact.
  const Certificate exact =
      certify(set, {{4.0 / 7, 2.0 / 7, 1.0 / 7}, {8.0, 0, 4.0, 0, 0, 2.0}}, Criterion::e());
  EXPECT_NEAR(exact.duality_gap, 0.0, 1e-14);
  EXPECT_NEAR(exact.dual_repair, 13.0, 1e-12);
  EXPECT_TRUE(std::isnan(certify(set, {weights}, Criterion::a()).dual_repair));
}

TEST(CriterionCertificate, RefusesWhatIsNoDesignOrNoCriterion) {
  const InformationSet set = orthogonal({1.0, 2.0, 4.0});
  for (const Criterion& criterion : {Criterion::a(), Criterion::e(), Criterion::ds({0})}) {
    EXPECT_EQ(certify(set, {{1.2, -0.1, -0.1}}, criterion).status, CertificateStatus::kNotADesign);
    EXPECT_EQ(certify(set, {{0.5, 0.5}}, criterion).status, CertificateStatus::kNotADesign);
    const Certificate singular = certify(set, {{0.5, 0.5, 0.0}}, criterion);
    EXPECT_EQ(singular.status, CertificateStatus::kSingular);
    EXPECT_TRUE(std::isinf(singular.duality_gap));
    EXPECT_EQ(singular.efficiency, 0.0);
  }
  const Design design{{0.3, 0.3, 0.4}};
  EXPECT_THROW(static_cast<void>(certify(set, design, Criterion::ds({3}))), InputError);
  EXPECT_THROW(static_cast<void>(certify(set, design, Criterion::l({1.0, 0.0, 1.0}))), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::ds({})), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::ds({1, 0, 1})), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::l({})), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::l({1.0, 0.0})), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::l({0.0, 0.0, 0.0})), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::l({1.0, 2.0, 1.0})), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::l({std::nan(""), 0.0, 1.0})), InputError);
  EXPECT_THROW(static_cast<void>(criterion_kind("d")), InputError);
}

}  // namespace
}  // namespace graybox
