// Swapped wires, wrong signs and units of rigid robots: of simulated arms, where everything is
// known, and of real recordings that are rewired here.
#include "diagnosis/wiring/wiring_faults.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "diagnosis/wiring/gravity_fault.hpp"
#include "diagnosis/wiring/wrap_faults.hpp"
#include "problems/base/random.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kDegrees = 180.0 / std::numbers::pi;

// The motors of arm and forearm both turn the forearm; everything is recorded at the motors.
constexpr const char* kCoupled = R"(transmission: [[100, 0, 0], [0, 120, 0], [0, 80, 80]]
channels:
  torque_of: motors
  position_of: motors
)";
constexpr const char* kDirect = R"(channels:
  torque_of: arm
  position_of: arm
)";

// A shoulder about the vertical axis, an arm and a forearm. `bodies`: of each link, or nothing
// where they are unknown.
std::string arm_file(const char* drives, const std::vector<std::string>& bodies = {"", "", ""}) {
  const bool is_direct = drives == kDirect;
  const auto ratio = [&](int gear) {
    return is_direct ? fmt::format("gear_ratio: {}, ", gear) : "";
  };
  return fmt::format(R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints:
  - {{name: base, a: 0, alpha: 0, d: 0.4, {}rotor_inertia: 1e-4{}}}
  - {{name: arm, a: 0.1, alpha: -90, d: 0, {}rotor_inertia: 1e-4{}}}
  - {{name: forearm, a: 0.6, alpha: 0, d: 0, {}rotor_inertia: 5e-5{}}}
{}  torque: [t1, t2, t3]
  position: [q1, q2, q3]
  velocity: [v1, v2, v3]
  acceleration: [a1, a2, a3]
)",
                     ratio(100), bodies[0], ratio(120), bodies[1], ratio(80), bodies[2], drives);
}

std::string body(double mass, double x, double inertia) {
  return fmt::format(
      ", body: {{mass: {:g}, centre_of_mass: [{:g}, 0.02, 0.03], inertia: {{xx: {:g}, yy: {:g}, "
      "zz: {:g}, xy: 0, xz: 0, yz: 0}}}}",
      mass, x, inertia, 1.3 * inertia, 1.2 * inertia);
}

// What moves and what drives it, noise included.
class RecordedArm {
 public:
  using Force = std::function<VectorXd(const VectorXd& q, const VectorXd& velocity)>;

  // `further`: forces that no model has. `reach`: of the motion, rad.
  explicit RecordedArm(std::uint64_t seed, const Force& further = {}, double reach = 0.4,
                       const char* drives = kDirect) {
    Random random(seed);
    testing::write_text(folder_.file("known.yaml"), arm_file(drives, bodies(random)));
    testing::write_text(folder_.file("unknown.yaml"), arm_file(drives));
    const RigidRobotModel robot = load_rigid_robot(folder_.file("known.yaml"));
    TorqueColumns dynamics(robot);
    for (int piece = 0; piece < 2; ++piece) {
      Motion motion = random_motion(random, reach);
      for (Index t = 0; t < motion.samples(); ++t) {
        const VectorXd q = motion.position.row(t), velocity = motion.velocity.row(t);
        dynamics.evaluate(q, velocity, motion.acceleration.row(t).transpose());
        VectorXd torque =
            dynamics.known() + 4.0 * velocity + 8.0 * (velocity / 0.05).array().tanh().matrix();
        if (further) torque += further(q, velocity);
        for (double& each : torque) each += 0.3 * random.normal();
        motion.torque.row(t) = torque;
      }
      pieces.push_back(std::move(motion));
    }
  }

  [[nodiscard]] RigidRobotModel model(const std::string& masses) const {
    return load_rigid_robot(folder_.file(masses + ".yaml"));
  }
  // With every recording changed.
  [[nodiscard]] std::vector<ChannelFault> faults(
      const std::string& masses, const std::function<void(Motion&)>& change = {}) const {
    std::vector<Motion> changed = pieces;
    for (Motion& piece : changed) {
      if (change) change(piece);
    }
    return find_wiring_faults(model(masses), changed);
  }

  std::vector<Motion> pieces;

 private:
  static std::vector<std::string> bodies(Random& random) {
    std::vector<std::string> result;
    for (const double size : {1.0, 0.8, 0.3}) {
      result.push_back(body(20.0 * size * random.uniform(0.7, 1.4), 0.35 * random.uniform(0.7, 1.3),
                            1.5 * size * random.uniform(0.7, 1.4)));
    }
    return result;
  }

  static Motion random_motion(Random& random, double reach) {
    constexpr Index kSamples = 3000;
    Motion motion;
    motion.time = VectorXd::LinSpaced(kSamples, 0.0, 30.0);
    motion.position = motion.velocity = motion.acceleration = motion.torque =
        MatrixXd::Zero(kSamples, 3);
    for (Index j = 0; j < 3; ++j) {
      for (int k = 1; k <= 5; ++k) {
        const double w = 2.0 * std::numbers::pi * random.uniform(0.05, 0.5);
        const double size = reach * random.normal(), phase = random.uniform(0.0, 6.28);
        const Eigen::ArrayXd angle = w * motion.time.array() + phase;
        motion.position.col(j).array() += size * angle.sin();
        motion.velocity.col(j).array() += size * w * angle.cos();
        motion.acceleration.col(j).array() -= size * w * w * angle.sin();
      }
    }
    return motion;
  }

  testing::TemporaryFolder folder_;
};

void swap_columns(MatrixXd& signals, Index a, Index b) { signals.col(a).swap(signals.col(b)); }

void turn_back(Motion& piece, Index j) {
  for (MatrixXd* signal : {&piece.position, &piece.velocity, &piece.acceleration}) {
    signal->col(j) *= -1.0;
  }
}

std::string messages(const std::vector<ChannelFault>& faults) {
  std::string text;
  for (const ChannelFault& fault : faults) text += fault.statement() + "\n";
  return text;
}

// Physics that is missing is no fault of the wires, however large: a spring as strong as gravity, a
// load, dry friction four times what the drives have, a force that follows another joint, torque
// that is late.
TEST(WiringFaults, AreNotFoundWhereThereAreNone) {
  const std::vector<RecordedArm::Force> missing{
      {},
      [](const VectorXd& q, const VectorXd&) { return VectorXd(60.0 * q); },
      [](const VectorXd& q, const VectorXd&) { return VectorXd(40.0 * q.array().cube()); },
      [](const VectorXd& q, const VectorXd&) { return VectorXd(30.0 * (3.0 * q).array().sin()); },
      [](const VectorXd&, const VectorXd& v) {
        return VectorXd(30.0 * (v / 0.01).array().tanh() *
                        (1.0 + 0.5 * (v.array() > 0.0).cast<double>()));
      },
      [](const VectorXd& q, const VectorXd&) { return VectorXd(50.0 * q.reverse()); },
      [](const VectorXd&, const VectorXd& v) { return VectorXd(20.0 * v.reverse()); }};
  for (std::size_t i = 0; i < missing.size(); ++i) {
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      const RecordedArm arm(seed, missing[i]);
      const RecordedArm hardly_moved(seed, missing[i], 0.02);
      for (const char* masses : {"known", "unknown"}) {
        EXPECT_EQ(messages(arm.faults(masses)), "")
            << "law " << i << ", seed " << seed << ", masses " << masses;
        EXPECT_EQ(messages(hardly_moved.faults(masses)), "")
            << "law " << i << ", seed " << seed << ", masses " << masses << ", small motion";
      }
    }
  }
  const RecordedArm arm(4);
  EXPECT_EQ(messages(arm.faults("unknown",
                                [](Motion& piece) {
                                  const MatrixXd torque = piece.torque;
                                  constexpr Index kLate = 5;  // samples, 0.05 s
                                  const Index n = torque.rows() - kLate;
                                  piece.torque.bottomRows(n) = torque.topRows(n);
                                })),
            "");
}

// The torques are those of an arm on the floor; the model hangs it up. (A first joint along gravity
// does not feel it, so the other directions are told by both of the others.)
TEST(WiringFaults, OfAnArmThatHangsElsewhereAreGravity) {
  for (const Eigen::Vector3d& stated :
       {Eigen::Vector3d(9.81, 0.0, 0.0), Eigen::Vector3d(0.0, 0.0, 9.81),
        Eigen::Vector3d(0.0, 0.0, 0.0), Eigen::Vector3d(0.0, 9.0, -4.0)}) {
    for (const std::uint64_t seed : {5U, 6U}) {
      const RecordedArm arm(seed);
      RigidRobotModel robot = arm.model("known");
      robot.gravity = stated;
      const std::vector<ChannelFault> found = find_wiring_faults(robot, arm.pieces);
      ASSERT_EQ(found.size(), 1U) << stated.transpose() << ": " << messages(found);
      EXPECT_NE(messages(found).find("gravity points elsewhere"), std::string::npos)
          << messages(found);
      const std::optional<GravityFault> fault = find_gravity_fault(robot, arm.pieces);
      ASSERT_TRUE(fault.has_value());
      EXPECT_LT((fault->gravity - Eigen::Vector3d(0.0, 0.0, -9.81)).norm(), 0.6)
          << fault->gravity.transpose();
    }
  }
}

struct Fault {
  std::string message;
  std::function<void(Motion&)> make;
};

void swap_motions(Motion& piece, Index a, Index b) {
  for (MatrixXd* signal : {&piece.position, &piece.velocity, &piece.acceleration}) {
    swap_columns(*signal, a, b);
  }
}

// One statement for one fault. (Where masses are not known and the arm is nearly the same without
// what a fault changes, others may do as well, and stand beside it.)
TEST(WiringFaults, AreNamedWhetherMassesAreKnownOrNot) {
  const std::vector<Fault> faults{
      {"t1 and t2 are swapped", [](Motion& piece) { swap_columns(piece.torque, 0, 1); }},
      {"t2 and t3 are swapped", [](Motion& piece) { swap_columns(piece.torque, 1, 2); }},
      {"q1 and q2 are swapped", [](Motion& piece) { swap_motions(piece, 0, 1); }},
      {"t2 has the wrong sign", [](Motion& piece) { piece.torque.col(1) *= -1.0; }},
      {"q2 has the wrong sign", [](Motion& piece) { turn_back(piece, 1); }},
      {"t3 and q3 both have the wrong sign: that of the axis or the gear ratio?",
       [](Motion& piece) {
         turn_back(piece, 2);
         piece.torque.col(2) *= -1.0;
       }},
      {"t2 is 1e+03 times too large for N m: thousandths of the unit stated?",
       [](Motion& piece) { piece.torque.col(1) *= 1000.0; }},
      {"t2 is 120 times too small: on the other side of the gear?",
       [](Motion& piece) { piece.torque.col(1) /= 120.0; }},
      {"q1, q2, q3: degrees, where radians are stated", [](Motion& piece) {
         for (MatrixXd* signal : {&piece.position, &piece.velocity, &piece.acceleration}) {
           *signal *= kDegrees;
         }
       }}};
  for (const Fault& fault : faults) {
    for (const std::uint64_t seed : {5U, 6U}) {
      const RecordedArm arm(seed);
      for (const char* masses : {"known", "unknown"}) {
        const std::vector<ChannelFault> found = arm.faults(masses, fault.make);
        const std::string where =
            fmt::format("{}, seed {}, masses {}: {}", fault.message, seed, masses, messages(found));
        EXPECT_EQ(found.size(), 1U) << where;
        EXPECT_NE(messages(found).find(fault.message), std::string::npos) << where;
      }
    }
  }
}

// The truth is in the class that is named, and a verdict without rivals is right.
TEST(WiringFaults, NameAClassThatHoldsTheTruth) {
  const std::vector<Fault> faults{
      {"t1 and t2 are swapped", [](Motion& piece) { swap_columns(piece.torque, 0, 1); }},
      {"q1 and q3 are swapped", [](Motion& piece) { swap_motions(piece, 0, 2); }},
      {"t3 has the wrong sign", [](Motion& piece) { piece.torque.col(2) *= -1.0; }},
      {"q2 has the wrong sign", [](Motion& piece) { turn_back(piece, 1); }},
      {"t2 is 1e+03 times too large", [](Motion& piece) { piece.torque.col(1) *= 1000.0; }},
      {"t2 is 120 times too small", [](Motion& piece) { piece.torque.col(1) /= 120.0; }},
      {"degrees, where radians are stated", [](Motion& piece) {
         for (MatrixXd* signal : {&piece.position, &piece.velocity, &piece.acceleration}) {
           *signal *= kDegrees;
         }
       }}};
  int cases = 0, held = 0, sure = 0, sure_and_wrong = 0;
  for (const Fault& fault : faults) {
    for (std::uint64_t seed = 21; seed < 25; ++seed) {
      const RecordedArm arm(seed);
      for (const char* masses : {"known", "unknown"}) {
        const std::vector<ChannelFault> found = arm.faults(masses, fault.make);
        ++cases;
        if (messages(found).find(fault.message) != std::string::npos) ++held;
        if (found.empty() || !found.front().rivals.empty()) continue;
        ++sure;
        if (found.front().message.find(fault.message) == std::string::npos) ++sure_and_wrong;
      }
    }
  }
  EXPECT_GE(held, static_cast<int>(std::ceil(0.95 * cases))) << "of " << cases;
  EXPECT_GT(sure, 0);
  EXPECT_EQ(sure_and_wrong, 0) << "of " << sure;
}

// A position in counts that wrap, and rates that are differentiated from it or recorded.
void wrap_first_joint(Motion& piece, double range) {
  for (double& q : piece.position.col(0)) q -= range * std::round(q / range);
}

TEST(WiringFaults, OfACounterThatWrapsAreNoWrongSign) {
  for (const std::uint64_t seed : {5U, 6U, 7U}) {
    const RecordedArm arm(seed);
    for (const bool rates_are_recorded : {true, false}) {
      for (const bool is_filtered : {false, true}) {
        const std::vector<ChannelFault> found = arm.faults("unknown", [&](Motion& piece) {
          wrap_first_joint(piece, 0.8);
          if (is_filtered) {
            constexpr double kCutOff = 10.0, kSample = 0.01;
            piece.position.col(0) =
                zero_phase_low_pass(piece.position.col(0), kCutOff * kSample, 4);
            piece.filters = {{kCutOff, 4}};
          }
          if (rates_are_recorded) return;
          piece.velocity.col(0) = time_derivative(piece.time, piece.position.col(0));
          piece.acceleration.col(0) = time_derivative(piece.time, piece.velocity.col(0));
        });
        const std::string said = messages(found);
        if (!is_filtered) {
          EXPECT_NE(said.find("q1 jumps"), std::string::npos) << seed << said;
        }
        EXPECT_EQ(said.find("wrong sign"), std::string::npos) << said;
      }
    }
  }
}

// One axis along which nothing but a carriage moves. `position`: its entry among the channels.
RigidRobotModel carriage_alone(const std::string& position = "position: [x], ") {
  const testing::TemporaryFolder folder;
  testing::write_text(folder.file("drive.yaml"), std::string(R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints:
  - {name: carriage, type: prismatic, alpha: 90, a: 0, d: 0, gear_ratio: 1, rotor_inertia: 0}
channels: {torque: [force], torque_of: arm, )") + position +
                                                     "position_of: arm, velocity: [v]}\n");
  return load_rigid_robot(folder.file("drive.yaml"));
}

// An angle every 4 ms after a low-pass of 50 Hz.
Motion filtered_angle(const VectorXd& angle) {
  constexpr double kStep = 0.004, kCutOff = 50.0;
  const MatrixXd filtered = zero_phase_low_pass(angle, kCutOff * kStep, 4);
  const MatrixXd nothing = MatrixXd::Zero(angle.size(), 1);
  const double last = kStep * static_cast<double>(angle.size() - 1);
  return {.time = VectorXd::LinSpaced(angle.size(), 0.0, last),
          .position = filtered,
          .velocity = nothing,
          .acceleration = nothing,
          .torque = nothing,
          .filters = {{kCutOff, 4}}};
}

// A joint that moves by 2 mrad within a few samples and rests, its encoder noisy.
TEST(WiringFaults, OfAJointThatComesToRestAreNoWraps) {
  const RigidRobotModel axis = carriage_alone();
  for (const double samples : {8.0, 10.0, 14.0}) {
    for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
      Random random(seed);
      VectorXd angle(200), wrapped(200);
      for (Index k = 0; k < angle.size(); ++k) {
        const double x = std::clamp(static_cast<double>(k - 40) / samples, 0.0, 1.0);
        angle(k) = 0.002 * x * x * x * (10.0 - 15.0 * x + 6.0 * x * x) + 3e-5 * random.normal();
        const double turned = 0.02 * static_cast<double>(k);  // of a period
        wrapped(k) = turned - std::round(turned);
      }
      EXPECT_EQ(messages(find_wraps(axis, std::vector<Motion>{filtered_angle(angle)})), "")
          << samples << ", seed " << seed;
      EXPECT_EQ(find_wraps(axis, std::vector<Motion>{filtered_angle(wrapped)}).size(), 1U);
    }
  }
}

// What is exchanged are the motors' signals, of which the joints' are mixtures.
TEST(WiringFaults, AreThoseOfTheMotorsWhereMotorsAreRecorded) {
  const RecordedArm arm(9, {}, 0.4, kCoupled);
  const MatrixXd n = arm.model("unknown").transmission, to_motors = n.inverse();
  EXPECT_EQ(messages(arm.faults("unknown")), "");
  const auto at_motors = [&](const std::function<void(Motion&)>& make) {
    return [&, make](Motion& piece) {
      for (MatrixXd* signal : {&piece.position, &piece.velocity, &piece.acceleration}) {
        *signal = (*signal * n.transpose()).eval();
      }
      piece.torque = (piece.torque * to_motors).eval();
      make(piece);
      for (MatrixXd* signal : {&piece.position, &piece.velocity, &piece.acceleration}) {
        *signal = (*signal * to_motors.transpose()).eval();
      }
      piece.torque = (piece.torque * n).eval();
    };
  };
  const std::vector<Fault> faults{
      {"t2 and t3 are swapped", [](Motion& piece) { swap_columns(piece.torque, 1, 2); }},
      {"q2 and q3 are swapped", [](Motion& piece) { swap_motions(piece, 1, 2); }},
      {"t2 has the wrong sign", [](Motion& piece) { piece.torque.col(1) *= -1.0; }},
      {"v2 or q2 has the wrong sign", [](Motion& piece) { piece.velocity.col(1) *= -1.0; }}};
  for (const Fault& fault : faults) {
    for (const char* masses : {"known", "unknown"}) {
      const std::string found = messages(arm.faults(masses, at_motors(fault.make)));
      EXPECT_NE(found.find(fault.message), std::string::npos)
          << fault.message << ", masses " << masses << ": " << found;
    }
  }
}

// Friction alone tells the sign of a carriage, and a spring is no fault.
TEST(WiringFaults, OfASingleAxisAreItsSign) {
  const RigidRobotModel drive = carriage_alone();
  const RecordedArm arm(10);
  for (const double stiffness : {0.0, 30.0}) {
    for (const double sign : {1.0, -1.0}) {
      std::vector<Motion> pieces;
      Random random(11);
      for (const Motion& piece : arm.pieces) {
        Motion one{piece.time, piece.position.col(0), piece.velocity.col(0),
                   piece.acceleration.col(0), MatrixXd(piece.samples(), 1)};
        for (Index t = 0; t < piece.samples(); ++t) {
          one.torque(t) = sign * (20.0 * one.acceleration(t) + 10.0 * one.velocity(t) +
                                  stiffness * one.position(t) + random.normal());
        }
        pieces.push_back(std::move(one));
      }
      const std::string found = messages(find_wiring_faults(drive, pieces));
      EXPECT_EQ(found, sign > 0.0 ? ""
                                  : "force or x has the wrong sign: by friction carriage would "
                                    "gain energy\n")
          << stiffness;
    }
  }
}

// An axis that its drive pulls back, and that is knocked away each time: the blows are against the
// drive, and yet no sign is wrong.
TEST(WiringFaults, OfASpeedThatBouncesAreNone) {
  const RigidRobotModel drive = carriage_alone("");
  constexpr double kStep = 0.004, kInertia = 0.01, kSlow = -3.0, kKnocked = 6.0;
  constexpr Index kCount = 1500;
  Random random(12);
  Motion piece{VectorXd(kCount), MatrixXd(kCount, 1), MatrixXd(kCount, 1), MatrixXd(kCount, 1),
               MatrixXd(kCount, 1)};
  double q = 0.0, v = 0.0;
  for (Index k = 0; k < kCount; ++k) {
    piece.time(k) = kStep * static_cast<double>(k);
    piece.position(k) = q;
    piece.velocity(k) = v;
    piece.torque(k) = -0.24 + 0.002 * random.normal();
    v += piece.torque(k) / kInertia * kStep;
    q += v * kStep;
    if (v < kSlow) v = kKnocked;
  }
  piece.acceleration = time_derivative(piece.time, piece.velocity.col(0));
  EXPECT_EQ(messages(find_wiring_faults(drive, std::vector<Motion>{piece})), "");
  EXPECT_TRUE(have_blows(drive, std::vector<Motion>{piece}));
  for (Index k = 0; k < kCount; ++k) piece.velocity(k) = std::sin(5.0 * piece.time(k));
  EXPECT_FALSE(have_blows(drive, std::vector<Motion>{piece}));
}

// A joint that is held, its sensors with an offset, a dead torque channel, and hardly any samples.
TEST(WiringFaults, AreNotMadeOfStandstill) {
  const RecordedArm arm(12);
  EXPECT_EQ(messages(arm.faults("unknown",
                                [](Motion& piece) {
                                  piece.position.col(0).setConstant(0.3);
                                  piece.velocity.col(0).setConstant(1e-3);
                                  piece.acceleration.col(0).setConstant(1e-3);
                                  piece.torque.col(0).setZero();
                                })),
            "");
  std::vector<Motion> little{arm.pieces.front()};
  Motion& piece = little.front();
  const auto few = Eigen::seq(0, 11);
  piece = {piece.time(few), piece.position(few, Eigen::all), piece.velocity(few, Eigen::all),
           piece.acceleration(few, Eigen::all), piece.torque(few, Eigen::all)};
  EXPECT_NO_THROW((void)find_wiring_faults(arm.model("unknown"), little));
}

// The masses of the base are its own, and take every sign. Friction does not.
TEST(WiringFaults, OfAJointThatSharesNothingAreToldByFriction) {
  const RecordedArm arm(7);
  const std::vector<ChannelFault> found =
      arm.faults("unknown", [](Motion& piece) { piece.torque.col(0) *= -1.0; });
  ASSERT_FALSE(found.empty());
  EXPECT_NE(found.front().message.find("has the wrong sign"), std::string::npos)
      << found.front().message;
  EXPECT_EQ(std::ranges::count(found.front().channels, "t1"), 1);
}

TEST(WiringFaults, OfRatesAreToldByThePositions) {
  const RecordedArm arm(8);
  const std::vector<Fault> faults{
      {"v2 or q2 has the wrong sign", [](Motion& piece) { piece.velocity.col(1) *= -1.0; }},
      {"v1 is the rate of q3 and not of q1: swapped?",
       [](Motion& piece) { swap_columns(piece.velocity, 0, 2); }},
      {"v3 is 57.3 times the rate of q3: one of them in degrees?",
       [](Motion& piece) { piece.velocity.col(2) *= kDegrees; }},
      {"a1 or v1 has the wrong sign", [](Motion& piece) { piece.acceleration.col(0) *= -1.0; }}};
  for (const Fault& fault : faults) {
    const std::string found = messages(arm.faults("unknown", fault.make));
    EXPECT_NE(found.find(fault.message), std::string::npos) << found;
  }
  // A filter's lag is none.
  EXPECT_EQ(messages(arm.faults("unknown",
                                [](Motion& piece) {
                                  MatrixXd& v = piece.velocity;
                                  for (Index t = 1; t < v.rows(); ++t) {
                                    v.row(t) = 0.8 * v.row(t - 1) + 0.2 * v.row(t);
                                  }
                                })),
            "");
}

// TX40 and KR300 with columns of the files exchanged and signs turned.
class RewiredRecordings : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::getenv("GRAYBOX_RECORDINGS") == nullptr) {
      GTEST_SKIP()
          << "set GRAYBOX_RECORDINGS to the folder of the recordings (docs/how_to/recordings.md)";
    }
  }

  struct Replacement {
    std::string from, to;
  };

  [[nodiscard]] std::string faults_of(const std::string& machine,
                                      const std::vector<Replacement>& replacements = {}) const {
    const std::filesystem::path source = GRAYBOX_SOURCE_DIR;
    std::string text =
        testing::read_text((source / "diagnosis/campaigns" / (machine + ".yaml")).string());
    for (const auto& [from, to] : replacements) {
      const std::size_t found = text.find(from);
      EXPECT_NE(found, std::string::npos) << from;
      if (found != std::string::npos) text.replace(found, from.size(), to);
    }
    testing::write_text(folder_.file("campaign.yaml"), text);
    const RigidRobotModel robot =
        load_rigid_robot(source / "docs/examples/rigid" / (machine + ".yaml"));
    std::vector<Motion> pieces;
    for (MotionRecord& record :
         read_motion_records(robot, read_campaign(folder_.file("campaign.yaml")))) {
      if (record.role != ExperimentRole::kEstimation) continue;
      for (Motion& piece : record.pieces) pieces.push_back(std::move(piece));
    }
    return messages(find_wiring_faults(robot, pieces));
  }

  testing::TemporaryFolder folder_;
};

TEST_F(RewiredRecordings, AreTold) {
  EXPECT_EQ(faults_of("tx40"), "");
  EXPECT_EQ(faults_of("kr300"), "");
  EXPECT_EQ(faults_of("tx40", {{"torque, column: Joint_1", "torque, column: Joint_2"},
                               {"torque_2, file: torque, column: Joint_2",
                                "torque_2, file: torque, column: Joint_1"}}),
            "t_1 and t_2 are swapped\n");
  EXPECT_EQ(faults_of("kr300", {{"pos_mot_deg[1]", "pos_mot_deg[@]"},
                                {"pos_mot_deg[2]", "pos_mot_deg[1]"},
                                {"pos_mot_deg[@]", "pos_mot_deg[2]"}}),
            "q_1 and q_2 are swapped\n");
  EXPECT_NE(
      faults_of("tx40", {{"torque, column: Joint_3, unit: N m",
                          "torque, column: Joint_3, unit: N m, gain: {value: -1, unit: N m/N m}"}})
          .find("t_3 has the wrong sign"),
      std::string::npos);
  // The sign of a gear ratio.
  EXPECT_NE(faults_of("tx40", {{"[0, 0, 45, 0, 0, 0]", "[0, 0, -45, 0, 0, 0]"}})
                .find("t_3 and q_3 both have the wrong sign"),
            std::string::npos);
}

// A load that pushes an axis which goes one way feeds it as friction of the other sign would.
TEST(WiringFaults, OfAWayWithoutBackAreNotTold) {
  const RigidRobotModel drive = carriage_alone();
  constexpr Index kSamples = 1000;
  for (const bool comes_back : {false, true}) {
    Random random(5);
    Motion way{VectorXd(kSamples), MatrixXd(kSamples, 1), MatrixXd(kSamples, 1),
               MatrixXd(kSamples, 1), MatrixXd(kSamples, 1)};
    const double mean = comes_back ? 0.0 : 1.0;
    for (Index k = 0; k < kSamples; ++k) {
      const double t = 0.01 * static_cast<double>(k);
      way.time(k) = t;
      way.position(k) = mean * t - 0.2 * std::cos(2.0 * t);
      way.velocity(k) = mean + 0.4 * std::sin(2.0 * t);
      way.acceleration(k) = 0.8 * std::cos(2.0 * t);
      way.torque(k) = -20.0 * way.acceleration(k) - 10.0 * way.velocity(k) + random.normal();
    }
    const std::string found = messages(find_wiring_faults(drive, std::vector<Motion>{way}));
    EXPECT_EQ(found.find("wrong sign") != std::string::npos, comes_back) << found;
  }
}

}  // namespace
}  // namespace graybox
