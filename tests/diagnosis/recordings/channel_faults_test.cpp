// Swapped wires, wrong signs and units, told from responses of two drives that hang together.
#include "diagnosis/hypotheses/channel_faults.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <string>

#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;

// Velocities of three coupled rotors, two of them driven; all inertias and stiffnesses off by up to
// 20 %.
MatrixXcd response(double w, Random* spread) {
  const auto about = [&](double value) {
    return spread == nullptr ? value : value * spread->uniform(0.8, 1.2);
  };
  Eigen::Matrix3d mass = Eigen::Vector3d(about(0.01), about(0.03), about(0.002)).asDiagonal();
  const double a = about(30.0), b = about(9.0);
  Eigen::Matrix3d stiffness;
  stiffness << a + 5.0, -a, 0.0, -a, a + b, -b, 0.0, -b, b;
  const Eigen::Matrix3d damping = 2e-3 * stiffness + Eigen::Matrix3d::Identity() * 0.02;
  const std::complex<double> jw(0.0, w);
  const MatrixXcd dynamic = stiffness.cast<std::complex<double>>() + jw * damping - w * w * mass;
  const MatrixXcd all = jw * dynamic.inverse();
  MatrixXcd seen(2, 2);
  seen << all(0, 0), all(0, 2), all(2, 0), all(2, 2);
  return seen;
}

ComparedResponses recorded(std::uint64_t seed, const std::function<void(MatrixXcd&)>& fault) {
  ComparedResponses compared;
  compared.inputs = {"u_1", "u_2"};
  compared.outputs = {"y_1", "y_2"};
  compared.input_units = {"N m", "N m"};
  compared.output_units = {"rad/s", "rad/s"};
  for (int k = 0; k < 40; ++k) {
    const double w = 2.0 * std::numbers::pi * std::pow(60.0, k / 39.0);
    Random spread(seed), noise(seed + 1000 + static_cast<std::uint64_t>(k));
    ComparedResponse& line = compared.lines.emplace_back();
    line.model = response(w, nullptr);
    line.measured = response(w, &spread);
    line.variance = MatrixXd::Constant(2, 2, 1e-4);
    for (auto& element : line.measured.reshaped()) {
      const double real = noise.normal();
      element += std::complex<double>(real, noise.normal()) * std::sqrt(0.5e-4);
    }
    fault(line.measured);
  }
  return compared;
}

constexpr int kSeeds = 40;

TEST(ChannelFaults, NoneAreClaimedForParametersThatAreOff) {
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const auto faults = find_channel_faults(recorded(seed, [](MatrixXcd&) {}));
    EXPECT_TRUE(faults.empty()) << seed << " " << faults.front().message;
  }
}

void expect_fault(const std::function<void(MatrixXcd&)>& fault, const std::string& message) {
  int found = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const auto faults = find_channel_faults(recorded(seed, fault));
    if (faults.size() == 1 && faults.front().message.find(message) != std::string::npos) ++found;
  }
  EXPECT_GE(found, kSeeds * 9 / 10) << message;
}

TEST(ChannelFaults, SignsAreTold) {
  expect_fault([](MatrixXcd& g) { g.row(1) *= -1.0; }, "y_2 has the wrong sign");
  expect_fault([](MatrixXcd& g) { g.col(0) *= -1.0; }, "u_1 has the wrong sign");
}

// Which of two joints it is can't be told: only what one does to the other changes its sign.
TEST(ChannelFaults, SignsOfGearRatiosAreTold) {
  expect_fault(
      [](MatrixXcd& g) {
        g.row(1) *= -1.0;
        g.col(1) *= -1.0;
      },
      "both have the wrong sign: that of the gear ratio?");
}

TEST(ChannelFaults, UnitsAreTold) {
  expect_fault([](MatrixXcd& g) { g.row(0) *= 180.0 / std::numbers::pi; },
               "times too large for rad/s: degrees?");
  expect_fault([](MatrixXcd& g) { g.row(1) *= 30.0 / std::numbers::pi; }, "revolutions a minute?");
  expect_fault([](MatrixXcd& g) { g.col(1) *= 1e3; }, "thousands of the unit stated?");
}

TEST(ChannelFaults, SwapsAreTold) {
  expect_fault([](MatrixXcd& g) { g.row(0).swap(g.row(1)); }, "y_1 and y_2 are swapped");
  expect_fault([](MatrixXcd& g) { g.col(0).swap(g.col(1)); }, "u_1 and u_2 are swapped");
}

TEST(ChannelFaults, TwoAreToldOneAfterTheOther) {
  const auto faults = find_channel_faults(recorded(3, [](MatrixXcd& g) {
    g.row(0) *= 180.0 / std::numbers::pi;
    g.row(1) *= -1.0;
  }));
  ASSERT_EQ(faults.size(), 2U);
  EXPECT_NE(faults[0].message.find("degrees"), std::string::npos);
  EXPECT_NE(faults[1].message.find("y_2 has the wrong sign"), std::string::npos);
}

// Nothing is said of what noise hides.
TEST(ChannelFaults, NoiseIsNoEvidence) {
  ComparedResponses compared = recorded(1, [](MatrixXcd& g) { g *= -1.0; });
  for (ComparedResponse& line : compared.lines) line.variance.setConstant(1e6);
  EXPECT_TRUE(find_channel_faults(compared).empty());
}

TEST(ChannelFaults, OneInputAndOutputShareTheBlame) {
  ComparedResponses compared = recorded(1, [](MatrixXcd& g) { g *= -1.0; });
  compared.inputs.resize(1);
  compared.outputs.resize(1);
  for (ComparedResponse& line : compared.lines) {
    line.measured = MatrixXcd(line.measured.topLeftCorner(1, 1));
    line.model = MatrixXcd(line.model.topLeftCorner(1, 1));
    line.variance = MatrixXd(line.variance.topLeftCorner(1, 1));
  }
  const auto faults = find_channel_faults(compared);
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_EQ(faults[0].message, "y_1 or u_1 has the wrong sign");
}

}  // namespace
}  // namespace graybox
