// By how many samples a drive is recorded late: of simulated motors with drives that are in time,
// late, or that answer the motion, in open and closed loop.
#include "diagnosis/signals/drive_lateness.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kStep = 0.005;

struct Motor {
  double inertia = 4e-4, damping = 0.03, friction = 0.02;
};

// The torque that acts over a sample, from the time, the position and the speed at its start.
using Drive = std::function<double(double, double, double)>;

LoggedDrive driven(const Motor& motor, const Drive& drive, Index samples, double noise,
                   unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> error(0.0, noise);
  LoggedDrive log{VectorXd(samples), VectorXd(samples), false};
  double x = 0.0, v = 0.0;
  for (Index k = 0; k < samples; ++k) {
    const double torque = drive(kStep * static_cast<double>(k), x, v);
    log.force(k) = torque;
    log.motion(k) = x + error(random);
    for (int step = 0; step < 50; ++step) {
      const double friction = motor.friction * std::tanh(v / 0.1);
      v += kStep / 50 * (torque - motor.damping * v - friction) / motor.inertia;
      x += kStep / 50 * v;
    }
  }
  return log;
}

double steps(double time, double, double) {
  const int part = static_cast<int>(time / 0.25) % 5;
  constexpr double kLevels[] = {0.0, 3.0, -3.0, 1.5, -1.0};
  return kLevels[part];
}

// What was recorded comes so many samples late; what acted before the log began is its first value.
LoggedDrive with_drive_late(const LoggedDrive& log, Index by) {
  LoggedDrive late = log;
  for (Index k = 0; k < log.force.size(); ++k) {
    late.force(k) = log.force(std::max<Index>(k - by, 0));
  }
  return late;
}

std::optional<Index> lateness(const LoggedDrive& log) { return drive_lateness({&log, 1}); }

TEST(DriveLateness, IsThatByWhichTheDriveWasMoved) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const LoggedDrive log = driven({}, steps, 400, 1e-3, seed);
    EXPECT_FALSE(lateness(log).has_value()) << seed;
    for (const Index by : {2, 5, 9}) {
      const std::optional<Index> found = lateness(with_drive_late(log, by));
      ASSERT_TRUE(found.has_value()) << seed << ", " << by;
      EXPECT_NEAR(static_cast<double>(*found), static_cast<double>(by), 1.0) << seed;
    }
  }
}

TEST(DriveLateness, IsReadFromSpeedsAndFromSeveralLogs) {
  std::vector<LoggedDrive> logs;
  for (const unsigned seed : {1U, 2U}) {
    LoggedDrive log = with_drive_late(driven({}, steps, 300, 0.0, seed), 4);
    const Index n = log.motion.size() - 1;
    log.motion = ((log.motion.tail(n) - log.motion.head(n)) / kStep).eval();
    log.force.conservativeResize(n);
    log.is_velocity = true;
    logs.push_back(log);
  }
  const std::optional<Index> found = drive_lateness(logs);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR(static_cast<double>(*found), 4.0, 1.0);
}

// A machine with dead time is late itself: that is physics, which laws describe.
TEST(DriveLateness, IsNoneWhereTheMotionIsLate) {
  const LoggedDrive log = driven({}, steps, 400, 1e-3, 7);
  LoggedDrive late = log;
  for (Index k = 0; k < log.motion.size(); ++k) {
    late.motion(k) = log.motion(std::max<Index>(k - 5, 0));
  }
  EXPECT_FALSE(lateness(late).has_value());
}

// A controller answers the motion that it causes: its torque is in time all the same.
TEST(DriveLateness, IsNoneInClosedLoop) {
  for (const double frequency : {1.0, 3.0, 7.0}) {
    const auto controller = [&](double time, double x, double v) {
      const double phase = 2.0 * M_PI * frequency * time;  // one sine has no lateness of its own
      const double wanted = 2.0 * std::sin(phase) + 0.7 * std::sin(2.3 * phase);
      return 3.0 * (wanted - x) - 0.05 * v;
    };
    EXPECT_FALSE(lateness(driven({}, controller, 1500, 1e-4, 3)).has_value()) << frequency;
    EXPECT_TRUE(lateness(with_drive_late(driven({}, controller, 1500, 1e-4, 3), 6)).has_value())
        << frequency;
  }
}

// Motion that another hand makes does not follow from the drive at any shift.
TEST(DriveLateness, IsNoneWhereTheDriveDoesNotMoveIt) {
  int claimed = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    LoggedDrive log{VectorXd(600), VectorXd(600), false};
    double force = 0.0, hand = 0.0, v = 0.0, x = 0.0;
    for (Index k = 0; k < 600; ++k) {
      force += 0.1 * (normal(random) - force);
      hand += 0.1 * (normal(random) - hand);
      v += 0.2 * (5.0 * hand - v);
      x += kStep * v;
      log.force(k) = force;
      log.motion(k) = x;
    }
    claimed += lateness(log).has_value() ? 1 : 0;
  }
  EXPECT_EQ(claimed, 0);
}

TEST(DriveLateness, IsNotAskedOfShortLogsAndOfWhatStands) {
  const LoggedDrive log = driven({}, steps, 400, 1e-3, 1);
  EXPECT_FALSE(lateness({log.force.head(80), log.motion.head(80), false}).has_value());
  EXPECT_FALSE(lateness({log.force, VectorXd::Zero(400), false}).has_value());
  EXPECT_FALSE(lateness({VectorXd::Zero(400), log.motion, false}).has_value());
}

}  // namespace
}  // namespace graybox
