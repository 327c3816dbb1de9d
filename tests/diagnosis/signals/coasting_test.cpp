// Which recordings show a motion with its drive and without it.
#include "diagnosis/signals/coasting.hpp"

#include <gtest/gtest.h>

#include <functional>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kSamples = 200;

VectorXd over_time(const std::function<double(Index)>& value) {
  VectorXd values(kSamples);
  for (Index k = 0; k < kSamples; ++k) values(k) = value(k);
  return values;
}

VectorXd pulses() {
  return over_time([](Index k) { return k / 25 % 2 == 0 ? 3.0 : 0.0; });
}

// Rises with a pulse and falls after it, by half in 8 samples.
VectorXd following(const VectorXd& drive) {
  VectorXd speed = VectorXd::Zero(kSamples);
  for (Index k = 1; k < kSamples; ++k) speed(k) = speed(k - 1) + (drive(k - 1) - speed(k - 1)) / 12;
  return speed;
}

VectorXd way_of(const VectorXd& speed) {
  VectorXd way = speed;
  for (Index k = 1; k < kSamples; ++k) way(k) += way(k - 1);
  return way;
}

TEST(Coasting, IsSeenAtPulses) {
  const VectorXd drive = pulses(), speed = following(drive);
  EXPECT_TRUE(moves_without_drive({{drive, speed, true}}));
  EXPECT_TRUE(moves_without_drive({{drive, way_of(speed), false}}));
  const VectorXd rippled =
      drive + 0.02 * over_time([](Index k) { return k % 2 == 0 ? 1.0 : -1.0; });
  EXPECT_TRUE(moves_without_drive({{rippled, speed, true}}));
}

TEST(Coasting, IsNotSeenWhereADriveNeverStopsOrNothingMovesWithoutIt) {
  const VectorXd drive = pulses();
  const VectorXd swung = over_time([](Index k) { return k / 25 % 2 == 0 ? 3.0 : -3.0; });
  EXPECT_FALSE(moves_without_drive({{swung, following(swung), true}}));
  EXPECT_FALSE(moves_without_drive({{drive, drive, true}}));  // stops at once
  const VectorXd none = VectorXd::Zero(kSamples);
  EXPECT_FALSE(moves_without_drive({{none, following(drive), true}}));
}

TEST(Coasting, TakesAllRecordingsTogether) {
  const VectorXd on = VectorXd::Constant(kSamples, 3.0), off = VectorXd::Zero(kSamples);
  const VectorXd falling = following(pulses()).reverse();
  EXPECT_FALSE(moves_without_drive({{on, following(on), true}}));
  EXPECT_TRUE(moves_without_drive({{on, following(on), true}, {off, falling, true}}));
}

}  // namespace
}  // namespace graybox
