// Loads that some recordings carry, and tools that the model does not know, in simulated robots
// with known truth: single joints above all.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/inverse_dynamics/inverse_dynamics_fit.hpp"
#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/verdict/extended_model.hpp"
#include "diagnosis/verdict/law_words.hpp"
#include "problems/base/random.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

using testing::replaced;

// Position, velocity and acceleration along a sum of sines.
std::array<double, 3> motion_at(double t, double phase) {
  std::array<double, 3> motion{};
  for (const auto& [amplitude, w] : {std::pair{0.8, 0.9}, std::pair{0.25, 2.7}}) {
    motion[0] += amplitude * std::sin(w * t + phase);
    motion[1] += amplitude * w * std::cos(w * t + phase);
    motion[2] -= amplitude * w * w * std::sin(w * t + phase);
  }
  return motion;
}

struct JointTruth {
  double inertia = 2.6, weight = 38.0, dry = 9.0, viscous = 14.0;  // at rest level: weight cos q
  double load_inertia = 1.74, load_weight = 23.5;
  double gain = 1.0;  // N m for one recorded unit
};

const std::string kJoint = R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints:
  - {name: shoulder, a: 0, alpha: 90, d: 0, gear_ratio: 1, rotor_inertia: 0}
channels:
  torque: [torque]
  torque_of: arm
  position: [q]
  position_of: arm
  velocity: [v]
  acceleration: [a]
)";

class Loads : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) /
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Two recordings without the load and two with it; of each the second is kept out.
  void record_joint(const JointTruth& truth, const std::string& model) {
    std::ofstream(folder_ / "model.yaml") << model;
    Random random(3);
    for (int run = 1; run <= 4; ++run) {
      const double load = run % 2 == 0 ? 1.0 : 0.0;
      std::ofstream file(folder_ / fmt::format("{}.csv", run));
      file << "torque,q,v,a\n";
      for (int k = 0; k < 1500; ++k) {
        const auto [q, v, a] = motion_at(0.01 * k, 0.9 * run);
        const double torque = (truth.inertia + load * truth.load_inertia) * a +
                              (truth.weight + load * truth.load_weight) * std::cos(q) +
                              truth.viscous * v + truth.dry * std::tanh(v / 0.005) +
                              0.4 * random.normal();
        file << fmt::format("{},{},{},{}\n", torque / truth.gain, q, v, a);
      }
    }
    write_campaign("tool");
  }

  void write_campaign(const std::string& kept_out_load) const {
    std::ofstream(folder_ / "campaign.yaml") << R"(format: graybox-campaign/1
sample_time: 0.01
channels:
  - {name: torque, unit: N m, is: input}
  - {name: q, unit: rad, is: output}
  - {name: v, unit: rad/s, is: output}
  - {name: a, unit: rad/s^2, is: output}
experiments:
  - {file: 1.csv}
  - {file: 2.csv, load: tool}
  - {file: 3.csv, role: validation}
  - {file: 4.csv, role: validation, load: )" << kept_out_load
                                             << "}\n";
  }

  [[nodiscard]] std::unique_ptr<MismatchProblem> problem() const {
    return force_balance_problem(folder_ / "model.yaml", read_campaign(folder_));
  }

  fs::path folder_;
};

const FittedLaw* found(const MismatchProblem& problem, const Diagnosis& diagnosis,
                       const std::string& law, const std::string& place) {
  for (const FoundEffect& effect : diagnosis.effects) {
    const Hypothesis& hypothesis = problem.hypotheses()[effect.law.hypothesis];
    if (hypothesis.law == law && hypothesis.place == place) return &effect.law;
  }
  return nullptr;
}

std::string all_found(const MismatchProblem& problem, const Diagnosis& diagnosis) {
  std::string names;
  for (const FoundEffect& effect : diagnosis.effects) {
    const Hypothesis& hypothesis = problem.hypotheses()[effect.law.hypothesis];
    names += hypothesis.law + " at " + hypothesis.place + "; ";
  }
  return names;
}

void expect_near(const LawParameterEstimate& estimate, double truth, double largest_error) {
  EXPECT_GT(estimate.standard_error, 0.0) << estimate.name;
  EXPECT_LT(estimate.standard_error, largest_error) << estimate.name;
  EXPECT_NEAR(estimate.value, truth, 4.0 * estimate.standard_error) << estimate.name;
}

const std::string kLoaded = "shoulder.arm with load tool";

// The tests that made the verdict what it is.
std::string all_failed(const Diagnosis& diagnosis) {
  std::string words;
  for (const VerdictReason& reason : diagnosis.reasons) {
    if (has_failed(reason)) words += reason.test + '\n';
  }
  return words;
}

// Of a drive whose gain is not known all is told in its own unit.
TEST_F(Loads, FindsTheWeightAndInertiaThatALoadAddsToASingleJoint) {
  for (const double gain : {1.0, 11.3}) {
    JointTruth truth;
    truth.gain = gain;
    record_joint(truth, gain == 1.0 ? kJoint
                                    : replaced(kJoint, "torque_of: arm",
                                               "torque_of: arm\n  drive_gains: unknown"));
    const auto data = problem();
    const Diagnosis diagnosis = diagnose(*data);
    const FittedLaw* weight = found(*data, diagnosis, "gravity", kLoaded);
    const FittedLaw* inertia = found(*data, diagnosis, "inertia", kLoaded);
    ASSERT_NE(weight, nullptr) << all_found(*data, diagnosis);
    ASSERT_NE(inertia, nullptr) << all_found(*data, diagnosis);
    EXPECT_EQ(diagnosis.effects.size(), 4U) << all_found(*data, diagnosis);
    expect_near(weight->parameters[0], 0.0, 0.3 / gain);
    expect_near(weight->parameters[1], truth.load_weight / gain, 0.3 / gain);
    expect_near(inertia->parameters[0], truth.load_inertia / gain, 0.1 / gain);
    EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << all_failed(diagnosis);
  }
}

TEST_F(Loads, SaysWhatOneJointTellsOfALoad) {
  record_joint({}, kJoint);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  const FittedLaw* weight = found(*data, diagnosis, "gravity", kLoaded);
  ASSERT_NE(weight, nullptr) << all_found(*data, diagnosis);
  const std::string words = law_sentence(data->hypotheses()[weight->hypothesis], *weight);
  EXPECT_NE(words.find("the arm axis of shoulder with load tool lifts the load: 23.5 N m at most"),
            std::string::npos)
      << words;
  EXPECT_NE(words.find("2.4 kg m, of which one joint can't tell mass and lever"), std::string::npos)
      << words;
}

// What only is called a load changes nothing.
TEST_F(Loads, ClaimsNoLoadWhereNoneIsCarried) {
  JointTruth truth;
  truth.load_inertia = truth.load_weight = 0.0;
  record_joint(truth, kJoint);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  EXPECT_EQ(diagnosis.effects.size(), 2U) << all_found(*data, diagnosis);
  EXPECT_EQ(all_found(*data, diagnosis).find("load"), std::string::npos)
      << all_found(*data, diagnosis);
}

TEST_F(Loads, ReadsBackTheLoadOfAJoint) {
  const JointTruth truth;
  record_joint(truth, kJoint);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_NE(found(*data, diagnosis, "inertia", kLoaded), nullptr) << all_found(*data, diagnosis);
  std::ofstream(folder_ / "again.yaml") << extended_model_text(
      folder_ / "model.yaml", folder_ / "again.yaml", diagnosis.after, data->hypotheses());
  const RigidRobotModel robot = load_rigid_robot(folder_ / "again.yaml");
  const InverseDynamicsFit fit =
      fit_inverse_dynamics(robot, read_motion_records(robot, read_campaign(folder_)), {});
  const std::string name = "found inertia at shoulder.arm with load tool.inertia";
  const auto inertia = std::ranges::find(fit.parameters, name, &TorqueParameter::name);
  ASSERT_NE(inertia, fit.parameters.end());
  EXPECT_NEAR(inertia->value, truth.load_inertia, 0.1);
}

// A force that one load adds and another takes away depends on the motion all the same.
TEST_F(Loads, SeesARestThatDiffersBetweenLoads) {
  JointTruth truth;
  truth.dry = truth.viscous = 0.0;
  record_joint(truth, kJoint);
  const auto data = problem();
  EXPECT_GT(data->remaining_structure(data->fit({}, nullptr)).value_or(0.0), 0.8);
}

TEST_F(Loads, NamesALoadThatTheFitNeverSaw) {
  record_joint({}, kJoint);
  write_campaign("crate");
  const auto data = problem();
  EXPECT_TRUE(std::ranges::any_of(data->remarks(), [](const std::string& remark) {
    return remark.find("load crate is in recordings kept out alone") != std::string::npos;
  }));
}

// A level arm of two links; the tool is 2.9 kg where the model has 0.8 kg.
const std::string kArm = R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints:
  - {name: joint1, alpha: 90, a: 0, d: 0.3, gear_ratio: 1, rotor_inertia: unknown,
     body: {mass: 9, centre_of_mass: [0.21, 0, 0],
            inertia: {xx: 0.01, yy: 0.17, zz: 0.17, xy: 0, xz: 0, yz: 0}}}
  - {name: joint2, alpha: 0, a: 0.45, d: 0, gear_ratio: 1, rotor_inertia: unknown,
     body: {mass: 5.8, centre_of_mass: [0.21, 0, 0],
            inertia: {xx: 0.01, yy: 0.14, zz: 0.14, xy: 0, xz: 0, yz: 0}}}
channels:
  torque: [u_1, u_2]
  torque_of: arm
  drive_gains: unknown
  position: [q_1, q_2]
  position_of: arm
  velocity: [v_1, v_2]
  acceleration: [a_1, a_2]
)";
const std::string kTool = R"(elements:
  - {name: tool, location: {kind: element, axis: flange}, law: payload,
     parameters: {mass: {value: 2.1, unit: kg}, x: {value: 0.46, unit: m},
                  y: {value: 0, unit: m}, z: {value: 0, unit: m}}}
known: [tool.mass]
)";

void write_arm(const fs::path& file, TorqueColumns& columns, double phase, Random& random) {
  std::ofstream stream(file);
  stream << "u_1,u_2,q_1,q_2,v_1,v_2,a_1,a_2\n";
  for (int k = 0; k < 1500; ++k) {
    const auto first = motion_at(0.01 * k, phase), second = motion_at(0.013 * k, 2.0 * phase + 1.0);
    const Eigen::Vector2d q(first[0], second[0]), v(first[1], 1.3 * second[1]),
        a(first[2], 1.69 * second[2]);
    columns.evaluate(q, v, a);
    Eigen::Vector2d torque = columns.known();
    torque +=
        Eigen::Vector2d(1.1, 0.35).cwiseProduct(a) + Eigen::Vector2d(9.0, 4.0).cwiseProduct(v);
    torque += Eigen::Vector2d(6.5, 3.2).cwiseProduct(Eigen::Vector2d((v / 0.005).array().tanh()));
    torque += 0.3 * Eigen::Vector2d(random.normal(), random.normal());
    stream << fmt::format("{},{},{},{},{},{},{},{}\n", torque(0) / 7.0, torque(1) / 3.0, q(0), q(1),
                          v(0), v(1), a(0), a(1));
  }
}

class ToolOfAnArm : public Loads {
 protected:
  void record_arm(const std::string& truth) {
    const std::string in_newtons = replaced(replaced(truth, "  drive_gains: unknown\n", ""),
                                            "rotor_inertia: unknown", "rotor_inertia: 0");
    std::ofstream(folder_ / "truth.yaml")
        << replaced(in_newtons, "rotor_inertia: unknown", "rotor_inertia: 0");
    std::ofstream(folder_ / "model.yaml") << kArm;
    std::ofstream campaign(folder_ / "campaign.yaml");
    campaign << "format: graybox-campaign/1\nsample_time: 0.01\nchannels:\n";
    for (const char* channel :
         {"u_{}, unit: N m, is: input", "q_{}, unit: rad, is: output",
          "v_{}, unit: rad/s, is: output", "a_{}, unit: rad/s^2, is: output"}) {
      for (const int joint : {1, 2}) {
        campaign << "  - {name: " << fmt::format(fmt::runtime(channel), joint) << "}\n";
      }
    }
    campaign << "experiments:\n  - {file: 1.csv}\n  - {file: 2.csv}\n"
                "  - {file: 3.csv, role: validation}\n";
    TorqueColumns columns(load_rigid_robot(folder_ / "truth.yaml"));
    Random random(11);
    for (int run = 1; run <= 3; ++run) {
      write_arm(folder_ / fmt::format("{}.csv", run), columns, 0.7 * run, random);
    }
  }
};

// One may not stand in for it: a spring at the first joint balances nothing at the second.
TEST_F(ToolOfAnArm, IsFoundWhereGainsAreUnknown) {
  record_arm(kArm + kTool);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  const FittedLaw* payload = found(*data, diagnosis, "payload", "flange");
  ASSERT_NE(payload, nullptr) << all_found(*data, diagnosis);
  EXPECT_EQ(diagnosis.effects.size(), 5U) << all_found(*data, diagnosis);
  expect_near(payload->parameters[0], 2.1, 0.3);
  expect_near(payload->parameters[1], 0.46, 0.05);
}

TEST_F(ToolOfAnArm, IsNotClaimedWhereTheModelHasIt) {
  record_arm(kArm);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  EXPECT_EQ(found(*data, diagnosis, "payload", "flange"), nullptr) << all_found(*data, diagnosis);
  EXPECT_EQ(diagnosis.effects.size(), 4U) << all_found(*data, diagnosis);
}

}  // namespace
}  // namespace graybox
