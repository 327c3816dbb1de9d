// Whether a recorded force is a command that is held to the next sample: it then acts half a sample
// later than it was recorded.
#include "diagnosis/force_balance_data/held_commands.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kSampleTime = 0.01, kMass = 2.0, kFriction = 0.7;
constexpr int kSamples = 2000, kSteps = 200;

// A force of three frequencies that changes by a fifth of its size from sample to sample.
double force_at(double time) {
  return 3.0 * std::sin(7.0 * time) + 2.0 * std::sin(19.0 * time + 1.0) +
         1.5 * std::sin(43.0 * time + 2.0);
}

// A mass with dry friction, simulated in steps of a two-hundredth of a sample.
MotionRecord record_of(bool is_held, double noise, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> error(0.0, noise);
  Motion motion;
  motion.time = Eigen::VectorXd::LinSpaced(kSamples, 0.0, kSampleTime * (kSamples - 1));
  motion.position.resize(kSamples, 1);
  motion.torque.resize(kSamples, 1);
  double position = 0.0, velocity = 0.3;
  for (Index k = 0; k < kSamples; ++k) {
    motion.position(k, 0) = position;
    motion.torque(k, 0) = force_at(motion.time(k)) + error(random);
    for (int step = 0; step < kSteps; ++step) {
      const double time = motion.time(k) + (step + 0.5) * kSampleTime / kSteps;
      const double acts = force_at(is_held ? motion.time(k) : time);
      const double friction = kFriction * std::tanh(velocity / 1e-3);
      const double before = velocity;
      velocity += kSampleTime / kSteps * (acts - friction) / kMass;
      position += kSampleTime / kSteps * 0.5 * (before + velocity);
    }
  }
  motion.velocity.setZero(kSamples, 1);
  motion.acceleration.setZero(kSamples, 1);
  for (Index k = 1; k + 1 < kSamples; ++k) {
    const double before = motion.position(k - 1, 0), after = motion.position(k + 1, 0);
    motion.velocity(k, 0) = (after - before) / (2.0 * kSampleTime);
    motion.acceleration(k, 0) =
        (after - 2.0 * motion.position(k, 0) + before) / (kSampleTime * kSampleTime);
  }
  MotionRecord record;
  record.pieces.push_back(samples_of(motion, 1, kSamples - 2));
  return record;
}

TEST(HeldCommands, ACommandThatIsHeldIsToldFromAForceThatWasMeasured) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    for (const double noise : {0.0, 0.05, 0.3}) {
      EXPECT_TRUE(are_held_commands({record_of(true, noise, seed)})) << noise;
      EXPECT_FALSE(are_held_commands({record_of(false, noise, seed)})) << noise;
    }
  }
}

TEST(HeldCommands, WhatIsKeptOutDoesNotDecide) {
  MotionRecord held = record_of(true, 0.0, 1);
  held.role = ExperimentRole::kValidation;
  EXPECT_FALSE(are_held_commands({record_of(false, 0.0, 1), held}));
}

// m (q_(k+1) - 2 q_k + q_(k-1))/T^2 is the mean of two commands where nothing else acts.
TEST(HeldCommands, TheMeanOfTwoCommandsIsWhatMovesTheMass) {
  std::vector<MotionRecord> records{record_of(true, 0.0, 1)};
  const auto rest = [&] {
    const Motion& motion = records.front().pieces.front();
    double squares = 0.0;
    Index moving = 0;
    for (Index k = 1; k < motion.samples(); ++k) {
      if (std::abs(motion.velocity(k, 0)) < 0.1) continue;  // friction turns within a sample
      const double friction = std::copysign(kFriction, motion.velocity(k, 0));
      const double left = motion.torque(k, 0) - kMass * motion.acceleration(k, 0) - friction;
      squares += left * left;
      ++moving;
    }
    return std::sqrt(squares / static_cast<double>(moving));
  };
  EXPECT_GT(rest(), 0.1);
  take_means_of_held(records);
  EXPECT_LT(rest(), 1e-3);
}

}  // namespace
}  // namespace graybox
