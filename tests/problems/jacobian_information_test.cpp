// Information matrices from Jacobians: numbers computed by hand, and what is refused.
#include "problems/information/jacobian_information.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "tests/support/refusal.hpp"

namespace graybox {
namespace {

void expect_packed(std::span<const double> packed, const std::vector<double>& expected) {
  ASSERT_EQ(packed.size(), expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    EXPECT_NEAR(packed[k], expected[k], 1e-13 * (1.0 + std::abs(expected[k]))) << k;
  }
}

// J = [1 2; 3 4], standard deviations 0.5 and 2: H = 4 (1,2)(1,2)^T + (3,4)(3,4)^T / 4.
TEST(JacobianInformation, IsTheSumOverOutputsOfSquaresOverVariances) {
  const std::vector<double> jacobian{1, 2, 3, 4}, deviations{0.5, 2.0};
  expect_packed(information(jacobian, 2, JacobianNoise::deviations(deviations)),
                {4.0 + 2.25, 8.0 + 3.0, 16.0 + 4.0});
}

// R = [2 1; 1 2], R^-1 = [2 -1; -1 2] / 3. With the same J:
// H_11 = (2 - 2*3 + 2*9) / 3, H_21 = (2*2 - (4 + 6) + 2*12) / 3, H_22 = (2*4 - 2*8 + 2*16) / 3.
TEST(JacobianInformation, TakesACovariance) {
  const std::vector<double> jacobian{1, 2, 3, 4}, covariance{2, 1, 1, 2};
  expect_packed(information(jacobian, 2, JacobianNoise::covariance(covariance, 2)),
                {14.0 / 3.0, 18.0 / 3.0, 24.0 / 3.0});
}

TEST(JacobianInformation, OfASetKeepsNamesAndCoordinates) {
  Jacobians jacobians{
      .candidates = 3, .outputs = 1, .parameters = 2, .values = {1, -1, 1, 0, 1, 1}};
  jacobians.names = {"offset", "slope"};
  jacobians.table = {{"x"}, {"m"}, {-1, 0, 1}};
  const InformationSet set = information_set_from_jacobians(
      jacobians, JacobianNoise::deviations(std::vector<double>{0.1}));
  EXPECT_EQ(set.candidate_count(), 3U);
  expect_packed(set.information(0), {100, -100, 100});
  expect_packed(set.information(1), {100, 0, 0});
  EXPECT_EQ(set.parameters(), jacobians.names);
  EXPECT_EQ(set.coordinates(2)[0], 1.0);
}

TEST(JacobianInformation, OfGeneralisedLinearModelsHasTheWeightOfEach) {
  const Jacobians rows{.candidates = 2, .outputs = 1, .parameters = 2, .values = {1, 2, 1, -3}};
  const std::vector<double> theta{0.5, 0.25};  // eta = 1 and -0.25
  const InformationSet poisson =
      generalised_linear_set(rows, GeneralisedLinearModel::kPoisson, theta);
  const double e = std::exp(1.0), f = std::exp(-0.25);
  expect_packed(poisson.information(0), {e, 2 * e, 4 * e});
  expect_packed(poisson.information(1), {f, -3 * f, 9 * f});
  const InformationSet logistic =
      generalised_linear_set(rows, GeneralisedLinearModel::kLogistic, theta);
  const double p = 1.0 / (1.0 + std::exp(-1.0)), v = p * (1.0 - p);
  expect_packed(logistic.information(0), {v, 2 * v, 4 * v});
  EXPECT_EQ(information_weight(GeneralisedLinearModel::kLogistic, 0.0), 0.25);
  EXPECT_EQ(information_weight(GeneralisedLinearModel::kLogistic, 800.0), 0.0);
  EXPECT_NEAR(information_weight(GeneralisedLinearModel::kLogistic, -40.0), std::exp(-40.0),
              1e-15 * std::exp(-40.0));
}

TEST(JacobianInformation, RefusesWhatIsNoNoiseAndNoJacobian) {
  using testing::expect_refused;
  const auto deviations = [](double value) {
    static_cast<void>(JacobianNoise::deviations(std::vector<double>{1.0, value}));
  };
  expect_refused([&] { deviations(0.0); }, "standard deviation 0 must be a positive number");
  expect_refused([&] { deviations(std::nan("")); }, "must be a positive number");
  const auto covariance = [](std::vector<double> matrix) {
    static_cast<void>(JacobianNoise::covariance(matrix, 2));
  };
  expect_refused([&] { covariance({1, 0.5, 0.4, 1}); }, "symmetric");
  expect_refused([&] { covariance({1, 2, 2, 1}); }, "positive definite");
  expect_refused([&] { covariance({1, 2, 2}); }, "has 4 entries, not 3");
  const auto noise = JacobianNoise::deviations(std::vector<double>{1.0});
  Jacobians jacobians{.candidates = 2, .outputs = 1, .parameters = 2, .values = {1, 2, 3}};
  const auto set = [&] { static_cast<void>(information_set_from_jacobians(jacobians, noise)); };
  expect_refused(set, "need 4");
  jacobians.values = {1, 2, 3, std::numeric_limits<double>::infinity()};
  expect_refused(set, "candidate 1 has an entry inf");
  jacobians.values = {1, 2, 3, 1e200};
  expect_refused(set, "candidate 1 overflows");
  jacobians.values = {1, 2, 3, 4};
  const auto poisson = [&](std::vector<double> theta) {
    static_cast<void>(generalised_linear_set(jacobians, GeneralisedLinearModel::kPoisson, theta));
  };
  expect_refused([&] { poisson({1}); }, "1 are given");
  expect_refused([&] { poisson({1000, 1}); }, "overflows");
}

}  // namespace
}  // namespace graybox
