// The work of drives on simulated masses: of the stated sign, of the other one, and braked by
// weights and springs.
#include "diagnosis/signals/drive_work.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

struct Driven {
  VectorXd force, position, velocity;
};

// A mass of 1 kg under f(t) and a force of its own g(x, v), and noise of 1e-3 at the position.
Driven driven(const std::function<double(double)>& f,
              const std::function<double(double, double)>& g) {
  constexpr Index kSamples = 2000;
  constexpr double kStep = 0.01;
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0.0, 1e-3);
  Driven result{VectorXd(kSamples), VectorXd(kSamples), VectorXd(kSamples)};
  double x = 0.0, v = 0.0;
  for (Index k = 0; k < kSamples; ++k) {
    const double force = f(kStep * static_cast<double>(k));
    result.force(k) = force;
    result.position(k) = x + noise(random);
    result.velocity(k) = v;
    for (int step = 0; step < 10; ++step) {
      v += 0.1 * kStep * (force + g(x, v));
      x += 0.1 * kStep * v;
    }
  }
  return result;
}

double there_and_back(double t) { return 5.0 * std::sin(2.0 * std::numbers::pi * t / 4.0); }

DriveWorkBothWays by_position(const Driven& log, double sign = 1.0) {
  return drive_work(sign * log.force, log.position, false);
}

TEST(DriveWork, OfAReversedDriveIsTakenBothWays) {
  const Driven log =
      driven(there_and_back, [](double, double v) { return -4.0 * v - std::tanh(100.0 * v); });
  EXPECT_FALSE(takes_energy_both_ways(by_position(log)));
  EXPECT_TRUE(takes_energy_both_ways(by_position(log, -1.0)));
  EXPECT_FALSE(takes_energy_both_ways(drive_work(log.force, log.velocity, true)));
  EXPECT_TRUE(takes_energy_both_ways(drive_work(-log.force, log.velocity, true)));
}

// Half of the time such drives brake, too.
TEST(DriveWork, OfMassesSpringsAndWeightsIsGivenAsOftenAsTaken) {
  const auto weight = [](double t) { return 10.0 + 2.0 * std::sin(t); };
  for (const double sign : {1.0, -1.0}) {
    const Driven mass = driven([](double t) { return std::cos(3.0 * t); },
                               [](double, double v) { return -0.01 * v; });
    EXPECT_FALSE(takes_energy_both_ways(by_position(mass, sign)));
    const Driven spring =
        driven(there_and_back, [](double x, double v) { return -200.0 * x - 0.2 * v; });
    EXPECT_FALSE(takes_energy_both_ways(by_position(spring, sign)));
    const Driven lifted = driven(weight, [](double x, double v) { return -10.0 - x - v; });
    EXPECT_FALSE(takes_energy_both_ways(by_position(lifted, sign)));
  }
}

TEST(DriveWork, OneWayTakesEnergyAndNotBothWays) {
  const Driven log = driven([](double) { return 2.0; }, [](double, double v) { return -v; });
  const DriveWorkBothWays work = by_position(log, -1.0);
  EXPECT_TRUE(takes_energy(work));
  EXPECT_FALSE(takes_energy_both_ways(work));
  EXPECT_LT(work.forwards.work, 0.0);
  EXPECT_FALSE(takes_energy(by_position(log)));
}

TEST(DriveWork, LeavesOutWhatIsMissing) {
  Driven log = driven(there_and_back, [](double, double v) { return -4.0 * v; });
  const DriveWorkBothWays whole = drive_work(log.force, log.velocity, true);
  log.velocity.segment(100, 50).setConstant(std::numeric_limits<double>::quiet_NaN());
  const DriveWorkBothWays part = drive_work(log.force, log.velocity, true);
  EXPECT_LT(part.forwards.moving + part.backwards.moving,
            whole.forwards.moving + whole.backwards.moving);
  EXPECT_TRUE(std::isfinite(part.forwards.work));
  EXPECT_TRUE(takes_energy_both_ways(drive_work(-log.force, log.velocity, true)));
  EXPECT_EQ(drive_work(log.force, log.velocity.head(5), true).forwards.moving, 0);
}

}  // namespace
}  // namespace graybox
