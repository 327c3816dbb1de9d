// What a drive gave while a machine stood still.
#include "diagnosis/signals/standing_drive.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kStep = 0.1;  // s

struct Log {
  VectorXd time, drive, position;
};

// The drive rises by one a sample, from 1; friction of `level` holds it, then the motion is fast.
Log breakaway(double level, Index samples, double weight = 0.0) {
  Log log{VectorXd(samples), VectorXd(samples), VectorXd(samples)};
  double position = 7.0;
  for (Index k = 0; k < samples; ++k) {
    log.time(k) = kStep * static_cast<double>(k);
    log.drive(k) = static_cast<double>(k + 1);
    log.position(k) = position;
    if (std::abs(log.drive(k) - weight) > level) position += 100.0;
  }
  return log;
}

StandingDrive drive_of(const Log& log, double band = 0.5) {
  return standing_drive(log.time, log.drive, stays(log.time, log.position, band, 0.2));
}

TEST(StandingDrive, TellsWhatFrictionHolds) {
  const StandingDrive drive = drive_of(breakaway(40.0, 60));
  // It moves under 41, and shows with the sample after it. What lasted 0.3 s before began at 37 or
  // 38, by how 0.3 s of steps of 0.1 s round.
  EXPECT_GE(drive.highest, 37.0);
  EXPECT_LE(drive.highest, 38.0);
  EXPECT_NEAR(drive.held(), 0.5 * (drive.highest - drive.lowest), 1e-12);
  EXPECT_GT(drive.held(), 16.0);
}

// A weight holds a drive, too, but not two that differ.
TEST(StandingDrive, HoldsNoMoreThanFrictionBesideAWeight) {
  const StandingDrive drive = drive_of(breakaway(20.0, 60, 15.0));
  EXPECT_LE(drive.held(), 20.0);
  EXPECT_GT(drive.held(), 13.0);
}

TEST(StandingDrive, IsNotSeenWhereNothingStands) {
  Log log = breakaway(0.5, 60);
  EXPECT_EQ(drive_of(log).held(), 0.0);
  log.drive.setConstant(3.0);
  log.position.setZero();
  EXPECT_EQ(drive_of(log).held(), 0.0) << "one drive tells nothing";
}

// A magnet that holds at two places under opposite drives is no friction.
TEST(StandingDrive, ComparesDrivesOfOnePlace) {
  constexpr Index kEach = 20;
  Log log{VectorXd::LinSpaced(2 * kEach, 0.0, kStep * (2 * kEach - 1)), VectorXd(2 * kEach),
          VectorXd(2 * kEach)};
  log.drive << VectorXd::Constant(kEach, -5.0), VectorXd::Constant(kEach, 5.0);
  log.position << VectorXd::Constant(kEach, 0.0), VectorXd::Constant(kEach, 9.0);
  EXPECT_EQ(drive_of(log).held(), 0.0);
  log.position.setZero();
  EXPECT_NEAR(drive_of(log).held(), 5.0, 1e-12);
}

// A drive that comes and goes within less than a late machine needs to answer was not held.
TEST(StandingDrive, CountsWhatLasted) {
  Log log{VectorXd::LinSpaced(40, 0.0, 3.9), VectorXd::Zero(40), VectorXd::Zero(40)};
  log.drive(20) = log.drive(21) = 50.0;
  EXPECT_EQ(drive_of(log).held(), 0.0);
  log.drive.segment(20, 8).setConstant(50.0);
  EXPECT_NEAR(drive_of(log).held(), 25.0, 1e-12);
}

TEST(Stays, AreStretchesWithinABand) {
  const VectorXd time = VectorXd::LinSpaced(10, 0.0, 0.9);
  VectorXd position(10);
  position << 0, 0, 1, 0, 5, 9, 9, 9, 9, 20;
  const std::vector<Stay> found = stays(time, position, 1.0, 0.25);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].first, 0);
  EXPECT_EQ(found[0].count, 4);
  EXPECT_EQ(found[1].first, 5);
  EXPECT_EQ(found[1].count, 4);
  EXPECT_TRUE(stays(time, position, 1.0, 0.5).empty());
}

TEST(SlowestLastingSpeed, PassesOverStartsAndStops) {
  VectorXd velocity(14);
  velocity << 0, 20, 300, 310, 305, 300, 40, 0, 0, -90, -100, -95, -3, 0;
  EXPECT_EQ(slowest_lasting_speed(velocity, 1), 100.0);  // 20, 40 and 3 are parts of one step
  EXPECT_EQ(slowest_lasting_speed(velocity, 3), 0.0) << "none lasted as long";
  const VectorXd sine = (VectorXd::LinSpaced(20001, 0.0, 6.283).array() + 0.3).sin();
  EXPECT_LT(slowest_lasting_speed(sine, 1), 1e-3) << "it passes through every speed";
}

}  // namespace
}  // namespace graybox
