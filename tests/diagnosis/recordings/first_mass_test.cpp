// Starts of one mass against machines that were simulated here in small steps: encoders of few
// counts, noise, tachometers, late sensors, weights, drives of the wrong sign, and logs that tell
// nothing.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "diagnosis/first_masses/free_response.hpp"
#include "diagnosis/first_masses/kept_out_blocks.hpp"
#include "diagnosis/first_masses/one_mass_start.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

struct TrueMass {
  double inertia, damping, dry = 0.0, weight = 0.0;
};

constexpr TrueMass kViscous{0.4, 12.0}, kDry{0.05, 0.3, 1.0};
constexpr double kStep = 0.001;

struct MassRun {
  VectorXd force, position, velocity;
};

MassRun run(const TrueMass& mass, const VectorXd& force) {
  constexpr int kSteps = 20;
  MassRun result{force, VectorXd(force.size()), VectorXd(force.size())};
  double q = 0.0, v = 0.0;
  for (Index k = 0; k < force.size(); ++k) {
    result.position(k) = q;
    result.velocity(k) = v;
    for (int s = 0; s < kSteps; ++s) {
      const double against =
          mass.damping * v + mass.dry * std::tanh(v / 0.02) + mass.weight * std::sin(q);
      v += (force(k) - against) / mass.inertia * kStep / kSteps;
      q += v * kStep / kSteps;
    }
  }
  return result;
}

// Steps either way with a sine, after a pause.
VectorXd steps(double size, Index count = 2400) {
  VectorXd force = VectorXd::Zero(count);
  for (Index k = 100; k < count; ++k) {
    const double t = kStep * static_cast<double>(k), turn = 2.0 * std::numbers::pi * t;
    force(k) = size * (0.7 * std::copysign(1.0, std::sin(1.3 * turn)) + 0.5 * std::sin(2.3 * turn));
  }
  return force;
}

MassRun run_of(const TrueMass& mass) { return run(mass, steps(mass.dry > 0.0 ? 5.0 : 200.0)); }

OneMassLog by_position(const VectorXd& force, const VectorXd& position) {
  return {force, position, false, true, kStep};
}

VectorXd in_counts(const VectorXd& position, double per_turn) {
  const double count = 2.0 * std::numbers::pi / per_turn;
  return count * (position / count).array().round();
}

VectorXd noisy(VectorXd signal, double deviation, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, deviation);
  for (double& value : signal) value += noise(random);
  return signal;
}

void expect_mass(const OneMassLog& log, const TrueMass& mass, double within, const char* what) {
  const OneMassStart start = start_one_mass(log);
  EXPECT_EQ(start.told, OneMassTold::kInertia) << what;
  EXPECT_NEAR(std::log(start.inertia / mass.inertia), 0.0, std::log(within)) << what;
  EXPECT_NEAR(std::log(start.damping / mass.damping), 0.0, std::log(within)) << what;
}

// Against v(t) = (1 - exp(-p t))/p and its integral, of a step.
TEST(FreeResponse, IsExactForAHeldForce) {
  for (const double pole : {0.0, 1e-9, 0.3, 400.0}) {
    const VectorXd ones = VectorXd::Ones(50);
    const VectorXd speed = FreeResponse(pole, 0.01, true, 50).of(ones);
    const VectorXd place = FreeResponse(pole, 0.01, false, 50).of(ones);
    for (Index k = 0; k < 50; ++k) {
      const double t = 0.01 * static_cast<double>(k);
      const double v = pole < 1e-6 ? t : (1.0 - std::exp(-pole * t)) / pole;
      const double x = pole < 1e-6 ? 0.5 * t * t : (t - v) / pole;
      EXPECT_NEAR(speed(k), v, 1e-9 + 1e-9 * v) << pole;
      EXPECT_NEAR(place(k), x, 1e-9 + 1e-7 * x) << pole;
    }
  }
}

TEST(FirstMass, FromFewCountsATurn) {
  for (const TrueMass& mass : {kViscous, kDry}) {
    const MassRun machine = run_of(mass);
    for (const double counts : {400.0, 600.0, 800.0, 1000.0, 1400.0, 2000.0}) {
      expect_mass(by_position(machine.force, in_counts(machine.position, counts)), mass, 1.2,
                  "counts");
    }
  }
}

TEST(FirstMass, FromNoiseAndTachometers) {
  for (const TrueMass& mass : {kViscous, kDry}) {
    const MassRun machine = run_of(mass);
    expect_mass(by_position(machine.force, noisy(machine.position, 0.01, 3)), mass, 1.2, "noise");
    const double speed = 0.05 * machine.velocity.cwiseAbs().maxCoeff();
    expect_mass({machine.force, noisy(machine.velocity, speed, 4), true, true, kStep}, mass, 1.2,
                "tachometer");
  }
}

// A lag of 10 ms, as of a filter.
TEST(FirstMass, FromASensorThatIsLate) {
  for (const TrueMass& mass : {kViscous, kDry}) {
    const MassRun machine = run_of(mass);
    VectorXd late = machine.position;
    for (Index k = 1; k < late.size(); ++k) {
      late(k) = late(k - 1) + (machine.position(k) - late(k - 1)) * kStep / 0.01;
    }
    expect_mass(by_position(machine.force, in_counts(late, 1000.0)), mass, 2.0, "lag");
  }
}

TEST(FirstMass, OneStepIsEnough) {
  VectorXd force = VectorXd::Constant(600, 150.0);
  force.head(50).setZero();
  const MassRun machine = run(kViscous, force);
  expect_mass(by_position(force, in_counts(machine.position, 400.0)), kViscous, 1.2, "step");
}

// In each log the drive stays at one level, so that friction is not told from it: by itself a log
// gives a mass that is too large. Two levels tell both, in either order.
TEST(FirstMass, LogsOfOneLevelEachTellTheMassTogether) {
  std::vector<OneMassLog> logs;
  for (const double level : {2.0, 3.0}) {
    const VectorXd force = VectorXd::Constant(600, level);
    logs.push_back({force, run(kDry, force).velocity, true, true, kStep});
    EXPECT_GT(start_one_mass(logs.back()).inertia, 1.4 * kDry.inertia);
  }
  const OneMassStart one = start_one_mass(logs);
  EXPECT_EQ(one.told, OneMassTold::kInertia);
  EXPECT_NEAR(one.inertia, kDry.inertia, 0.1 * kDry.inertia);
  EXPECT_NEAR(one.damping, kDry.damping, 0.1 * kDry.damping);
  logs.push_back({VectorXd::Ones(5), VectorXd::Ones(5), true, true, kStep});  // too short
  std::ranges::reverse(logs);
  const OneMassStart other = start_one_mass(logs);
  EXPECT_EQ(other.told, one.told);
  EXPECT_EQ(other.inertia, one.inertia);
  EXPECT_EQ(other.damping, one.damping);
  EXPECT_EQ(other.spread, one.spread);
}

// Pushes of one sign; the arm falls back.
TEST(FirstMass, AWeightIsNotTakenForTheMass) {
  constexpr TrueMass kArm{0.4, 4.0, 0.0, 60.0};
  VectorXd force = VectorXd::Zero(6000);
  for (Index k = 300; k < 6000; k += 1500) force.segment(k, 200 + k / 20).setConstant(90.0);
  const MassRun machine = run(kArm, force);
  const OneMassLog log = by_position(force, in_counts(machine.position, 400.0));
  expect_mass(log, kArm, 1.2, "weight");
  const OneMassStart start = start_one_mass(log);
  EXPECT_NEAR(start.sine, kArm.weight, 0.1 * kArm.weight);
  EXPECT_NEAR(start.cosine, 0.0, 0.1 * kArm.weight);
}

TEST(FirstMass, ADriveOfTheWrongSignIsTold) {
  for (const TrueMass& mass : {kViscous, kDry}) {
    const MassRun machine = run_of(mass);
    const OneMassStart start =
        start_one_mass(by_position(-machine.force, in_counts(machine.position, 800.0)));
    EXPECT_EQ(start.told, OneMassTold::kReversed);
    EXPECT_NEAR(start.inertia, mass.inertia, 0.1 * mass.inertia);
  }
}

// Beside a weight and a spring the sign of a drive is told, and that of a sound one is not doubted.
TEST(FirstMass, AReversedDriveIsProvedBesideAWeight) {
  constexpr TrueMass kArm{0.05, 0.3, 1.0, 2.0};
  for (const TrueMass& mass : {kDry, kArm}) {
    const MassRun machine = run(mass, steps(5.0, 6000));
    const VectorXd counts = in_counts(machine.position, 4000.0);
    const OneMassStart start = start_one_mass(by_position(-machine.force, counts));
    EXPECT_EQ(start.told, OneMassTold::kReversed);
    ASSERT_TRUE(start.is_proved);
    EXPECT_GT(start.proved, 5.0 * start.proved_error);
    EXPECT_NEAR(start.proved, mass.inertia, 0.3 * mass.inertia);
    const OneMassStart right = start_one_mass(by_position(machine.force, counts));
    EXPECT_EQ(right.told, OneMassTold::kInertia);
    EXPECT_FALSE(right.is_proved);
    const OneMassStart by_speed =
        start_one_mass({-machine.force, machine.velocity, true, true, kStep});
    EXPECT_TRUE(by_speed.is_proved);
  }
}

// A motion that a drive does not explain proves nothing.
TEST(FirstMass, AMotionOfItsOwnProvesNoSign) {
  const MassRun machine = run_of(kViscous);
  for (const unsigned seed : {5U, 6U, 7U, 8U}) {
    const VectorXd other = run(kViscous, noisy(VectorXd::Zero(2400), 2000.0, seed)).position;
    EXPECT_FALSE(start_one_mass(by_position(machine.force, other)).is_proved);
    EXPECT_FALSE(start_one_mass(by_position(-machine.force, other)).is_proved);
  }
}

TEST(FirstMass, AMotionOfItsOwnTellsNothing) {
  const MassRun machine = run_of(kViscous);
  const VectorXd other = run(kViscous, noisy(VectorXd::Zero(2400), 2000.0, 5)).position;
  const OneMassStart start = start_one_mass(by_position(machine.force, other));
  EXPECT_EQ(start.told, OneMassTold::kNothing);
  EXPECT_EQ(start_one_mass(by_position(VectorXd::Zero(2400), other)).told, OneMassTold::kNothing);
}

TEST(FirstMass, FollowsTheUnitOfTheForce) {
  const MassRun machine = run_of(kDry);
  const VectorXd counts = in_counts(machine.position, 1000.0);
  const OneMassStart one = start_one_mass(by_position(machine.force, counts));
  const OneMassStart thousand = start_one_mass(by_position(1000.0 * machine.force, counts));
  EXPECT_NEAR(thousand.inertia, 1000.0 * one.inertia, 1e-6 * thousand.inertia);
  EXPECT_NEAR(thousand.damping, 1000.0 * one.damping, 1e-6 * thousand.damping);
}

// ---- what is kept out ---------------------------------------------------------------------------

TEST(KeptOutBlocks, HalvesThatAreAlikeStay) {
  const MassRun machine = run_of(kDry);
  const KeptOutBlocks split = kept_out_blocks(machine.force, machine.position, false);
  EXPECT_EQ(split.count, 2);
  EXPECT_TRUE(split.reason.empty());
}

// A speed that follows its drive from row to row tells the damping alone: a mass that is no more
// than damping times the time of a row is that of the rows.
TEST(FirstMass, IsNotToldBySpeedsThatFollowAtOnce) {
  const VectorXd force = steps(200.0);
  VectorXd speed = VectorXd::Zero(force.size());
  for (Index k = 1; k < force.size(); ++k) speed(k) = force(k - 1) / 12.0;
  speed = noisy(speed, 0.02, 3);
  const OneMassStart start = start_one_mass({{force, speed, true, true, kStep}});
  EXPECT_NE(start.told, OneMassTold::kInertia) << start.inertia;
  EXPECT_NEAR(start.damping, 12.0, 3.0);
}

// Each part has its share of the drive, whichever half was without.
TEST(KeptOutBlocks, ADriveInOneHalfIsShared) {
  for (const bool is_late : {false, true}) {
    VectorXd force = steps(200.0);
    (is_late ? force.head(1300) : force.tail(1300)).setZero();
    const KeptOutBlocks split = kept_out_blocks(force, run(kViscous, force).position, false);
    ASSERT_GT(split.count, 2);
    double kept = 0.0;
    for (Index k = 0; k < force.size(); ++k) {
      if (k * split.count / force.size() % 2 == 1) kept += force(k) * force(k);
    }
    EXPECT_GT(kept / force.squaredNorm(), 0.2);
    EXPECT_LT(kept / force.squaredNorm(), 0.8);
  }
}

// There and back once: dry friction and a constant force are one thing in each half.
TEST(KeptOutBlocks, OneStrokeThereAndBackIsShared) {
  constexpr Index kCount = 2000;
  VectorXd position(kCount), force(kCount);
  for (Index k = 0; k < kCount; ++k) {
    const double turn = 2.0 * std::numbers::pi * static_cast<double>(k) / kCount;
    position(k) = 1.0 - std::cos(turn);
    force(k) = std::sin(turn) + 0.3 * std::sin(11.0 * turn);
  }
  const KeptOutBlocks split = kept_out_blocks(force, position, false);
  ASSERT_GT(split.count, 2);
  EXPECT_EQ(split.reason, "the axis goes one way in each half");
  // Three times there and back: halves hold both ways.
  for (Index k = 0; k < kCount; ++k) {
    position(k) = 1.0 - std::cos(6.0 * std::numbers::pi * static_cast<double>(k) / kCount);
  }
  EXPECT_EQ(kept_out_blocks(force, position, false).count, 2);
}

// A stroke and a half: each half goes mostly one way. Short logs can't be cut in more parts.
TEST(KeptOutBlocks, AStrokeAndAHalfIsSharedOrNotSplit) {
  for (const Index count : {280, 4000}) {
    VectorXd position(count), force(count);
    for (Index k = 0; k < count; ++k) {
      const double turn =
          0.85 * 2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(count);
      position(k) = std::sin(turn);
      force(k) = std::cos(turn) + 0.3 * std::sin(11.0 * turn);
    }
    const KeptOutBlocks split = kept_out_blocks(force, position, false);
    EXPECT_EQ(split.reason, "the axis turns round only once or twice");
    EXPECT_EQ(split.is_fair, count > 1000);
    EXPECT_EQ(split.count > 2, count > 1000);
  }
}

// Steady motion tells no mass: both parts need starts.
TEST(KeptOutBlocks, StartsAreShared) {
  const auto speed_of = [](const VectorXd& force) {
    VectorXd speed(force.size());
    double v = 0.0;
    for (Index k = 0; k < force.size(); ++k) speed(k) = v += 0.05 * (force(k) - v);
    return speed;
  };
  VectorXd force = VectorXd::Ones(1200);
  const KeptOutBlocks once = kept_out_blocks(force, speed_of(force), true);
  EXPECT_FALSE(once.is_fair);
  EXPECT_EQ(once.reason, "the drive makes one step or pulse");
  for (Index k = 0; k < 600; ++k) force(k) = k / 75 % 2 == 0 ? 1.0 : 0.4;
  const KeptOutBlocks more = kept_out_blocks(force, speed_of(force), true);
  EXPECT_EQ(more.reason, "starts and stops are in one half");
  EXPECT_TRUE(more.is_fair);
  EXPECT_GT(more.count, 2);
}

// A step, a pulse, or a drive that is on: one transient. Noise of what the encoder says in steady
// motion shows no second one.
TEST(KeptOutBlocks, OneTransientIsNotShared) {
  const auto speed_of = [](const VectorXd& force) {
    VectorXd speed(force.size());
    double v = 0.0;
    for (Index k = 0; k < force.size(); ++k) {
      v += 0.05 * (force(k) - v);
      speed(k) = 0.02 * std::round(v / 0.02 + 0.8 * std::sin(0.7 * static_cast<double>(k)));
    }
    return speed;
  };
  VectorXd step = VectorXd::Zero(1200), pulse = VectorXd::Zero(1200);
  step.tail(400).setConstant(1.0);
  pulse.segment(300, 500).setConstant(-2.0);
  for (const VectorXd& drive : {step, pulse, VectorXd(VectorXd::Constant(1200, 3.0))}) {
    const KeptOutBlocks split = kept_out_blocks(drive, speed_of(drive), true);
    EXPECT_FALSE(split.is_fair);
    EXPECT_EQ(split.reason, "the drive makes one step or pulse");
  }
  // Two pulses are two transients; and what swings freely has many.
  pulse.tail(300).setConstant(-2.0);
  EXPECT_NE(kept_out_blocks(pulse, speed_of(pulse), true).reason,
            "the drive makes one step or pulse");
  VectorXd swing(1200);
  for (Index k = 0; k < 1200; ++k) swing(k) = std::sin(0.1 * static_cast<double>(k));
  EXPECT_TRUE(kept_out_blocks(VectorXd::Zero(1200), swing, false).is_fair);
  EXPECT_TRUE(kept_out_blocks(VectorXd::Ones(1200), swing, false).is_fair);
}

// At rest and in steady motion the last counts of an encoder go to and fro: no turns of the motion.
TEST(KeptOutBlocks, CountsThatTrembleDontHideOneTransient) {
  VectorXd position(400), step = VectorXd::Zero(400);
  step.tail(350).setConstant(1.0);
  double q = 0.0, v = 0.0;
  for (Index k = 0; k < 400; ++k) {
    v += 0.02 * (4.0 * step(k) - v);
    q += v;
    position(k) = std::round(q + std::sin(2.3 * static_cast<double>(k)));
  }
  for (const VectorXd& drive : {step, VectorXd(VectorXd::Ones(400))}) {
    const KeptOutBlocks split = kept_out_blocks(drive, position, false);
    EXPECT_EQ(split.reason, "the drive makes one step or pulse");
    EXPECT_FALSE(split.is_fair);
  }
}

// From full speed one way to full speed the other way: quarters hold both ways.
TEST(KeptOutBlocks, AShortSweepThroughZeroIsQuartered) {
  const auto split_of = [](Index count) {
    VectorXd drive = VectorXd::LinSpaced(count, -1.0, 1.0), speed(count);
    for (Index k = 0; k < count; ++k) {
      const double moved = std::max(std::abs(drive(k)) - 0.1, 0.0);
      speed(k) = std::copysign(moved, drive(k)) + 0.01 * std::sin(0.7 * static_cast<double>(k));
    }
    return kept_out_blocks(drive, speed, true);
  };
  const KeptOutBlocks split = split_of(216);
  EXPECT_EQ(split.reason, "the axis goes one way in each half");
  EXPECT_TRUE(split.is_fair);
  EXPECT_EQ(split.count, 4);
  EXPECT_FALSE(split_of(150).is_fair);  // parts of 37 samples tell nothing
}

// A chirp of five periods has no parts of a period each that are alike; one of fifty has.
TEST(KeptOutBlocks, PartsOfAChirpHoldAPeriod) {
  const auto chirp = [](double periods) {
    VectorXd force(1200);
    for (Index k = 0; k < 1200; ++k) {
      const double share = static_cast<double>(k) / 1200.0;
      force(k) = std::sin(2.0 * std::numbers::pi * periods * share * share);
    }
    return kept_out_blocks(force, run(kViscous, force).position, false);
  };
  EXPECT_FALSE(chirp(5.0).is_fair);
  EXPECT_TRUE(chirp(50.0).is_fair);
  EXPECT_GT(chirp(50.0).count, 2);
}

// Two periods and a half: a half of them is all slow. What only grows, or goes on, is no sweep.
TEST(KeptOutBlocks, ASlowSweepIsNotHalved) {
  constexpr Index kCount = 524;
  constexpr double kLength = 5.24;
  const auto split = [&](double first, double last, double grows) {
    VectorXd force(kCount), place(kCount);
    for (Index k = 0; k < kCount; ++k) {
      const double t = kLength * static_cast<double>(k) / kCount;
      const double turn = 2.0 * std::numbers::pi * t * (first + 0.5 * (last - first) * t / kLength);
      const double size = 1.0 + grows * t / kLength;
      place(k) = 5.0 * size * std::sin(turn);
      force(k) = size * (std::cos(turn) + 0.2 * std::sin(turn));
    }
    return kept_out_blocks(force, place, false);
  };
  for (const bool rises : {true, false}) {
    const KeptOutBlocks slow = rises ? split(0.25, 0.8, 0.0) : split(0.8, 0.25, 0.0);
    EXPECT_EQ(slow.reason, "the drive's frequency changes along the log") << rises;
    EXPECT_FALSE(slow.is_fair) << rises;
  }
  const KeptOutBlocks more = split(1.0, 3.2, 0.0);
  EXPECT_EQ(more.reason, "the drive's frequency changes along the log");
  EXPECT_EQ(split(0.6, 0.6, 0.0).reason, "");
  EXPECT_EQ(split(0.6, 0.6, 2.0).reason, "");
}

// A rapid move first, then slow ones either way. A drive of friction alone shows no mass, and its
// halves have both ways; one that starts a mass shows it, and then one half has the starts.
TEST(KeptOutBlocks, WithoutAMassBothWaysAreEnough) {
  constexpr Index kCount = 140;
  std::mt19937_64 random(11);
  std::normal_distribution<double> noise(0.0, 0.3);
  VectorXd friction(kCount), place(kCount);
  double q = 0.0, v = 0.0, before = 0.0;
  VectorXd heavy(kCount);
  for (Index k = 0; k < kCount; ++k) {
    const double way = k % 20 < 10 ? 1.0 : -1.0;
    v = k < 20 ? 4.0 * way : 0.7 * way;
    q += v;
    place(k) = q;
    friction(k) = way + 0.1 * v + noise(random);
    heavy(k) = friction(k) + 10.0 * (v - before);
    before = v;
  }
  EXPECT_EQ(kept_out_blocks(friction, place, false).reason, "");
  EXPECT_EQ(kept_out_blocks(heavy, place, false).reason, "starts and stops are in one half");
}

// A push of a few samples can't be shared.
TEST(KeptOutBlocks, AKickIsNotShared) {
  VectorXd force = VectorXd::Zero(2000);
  force.segment(130, 8).setConstant(100.0);
  const KeptOutBlocks split = kept_out_blocks(force, run(kViscous, force).position, false);
  EXPECT_EQ(split.count, 2);
  EXPECT_FALSE(split.is_fair);
}

// Two axes: one swings throughout, the other turns back half-way, or stands.
TEST(KeptOutBlocks, SeveralAxesAreSharedTogether) {
  constexpr Index kCount = 1200;
  VectorXd force(kCount), swings(kCount), turns(kCount), stands(kCount);
  for (Index k = 0; k < kCount; ++k) {
    const double t = 0.01 * static_cast<double>(k);
    force(k) = std::sin(7.0 * t);
    swings(k) = std::sin(5.0 * t) + 0.5 * std::sin(11.0 * t);
    turns(k) = k < kCount / 2 ? t + 0.3 * std::sin(2.0 * t) : 12.0 - t + 0.3 * std::sin(2.0 * t);
    stands(k) = k < kCount / 2 ? std::sin(5.0 * t) : std::sin(0.05 * kCount / 2.0);
  }
  EXPECT_EQ(kept_out_blocks({{force, swings}, {force, -swings}}, 20).count, 2);
  EXPECT_EQ(kept_out_blocks({{force, swings}, {force, -swings}}, 20).reason, "");
  for (const VectorXd& other : {turns, stands}) {
    const KeptOutBlocks split = kept_out_blocks({{force, swings}, {force, other}}, 20);
    EXPECT_EQ(split.axis, 1U);
    EXPECT_FALSE(split.reason.empty());
    EXPECT_EQ(split.count, kept_out_blocks(force, other, false).count);
    EXPECT_EQ(split.count == 2, !split.is_fair);
    // A filter that takes most of each block forbids them.
    EXPECT_EQ(kept_out_blocks({{force, swings}, {force, other}}, 280).count, 2);
  }
  EXPECT_GT(kept_out_blocks({{force, swings}, {force, turns}}, 20).count, 2);
}

}  // namespace
}  // namespace graybox
