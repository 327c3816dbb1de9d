// Missing physics in the force balance of simulated drives, where the truth is known.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <numbers>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/force_balance/balance_regression.hpp"
#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/force_balance/remaining_structure.hpp"
#include "diagnosis/force_balance_data/derivative_noise.hpp"
#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/force_balance_data/standstill.hpp"
#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/inverse_dynamics/inverse_dynamics_fit.hpp"
#include "diagnosis/inverse_dynamics/law_force.hpp"
#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "diagnosis/plausibility/plausibility.hpp"
#include "diagnosis/recordings/preprocess.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/signals/coloured_noise.hpp"
#include "diagnosis/verdict/extended_model.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/laws/law_catalogue.hpp"
#include "tests/support/carriage_files.hpp"
#include "tests/support/recorded_carriage.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

using testing::replaced;

class ForceBalance : public testing::RecordedCarriage {};

using testing::named;

// Magnets of a linear motor: some twenty and forty waves of the recorded range.
TEST_F(ForceBalance, FindsTheCoggingOfALongStroke) {
  constexpr double kPitch = 0.036;
  record(
      [](double x, double) {
        const double angle = 2.0 * std::numbers::pi * x / kPitch;
        return 3.0 * std::sin(angle) + 1.5 * std::sin(2.0 * angle + 1.0);
      },
      0.3, 5);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  std::vector<double> periods;
  for (const FoundEffect& effect : diagnosis.effects) {
    EXPECT_EQ(named(*data, effect).law, "ripple");
    periods.push_back(effect.law.parameters[1].value);
  }
  std::ranges::sort(periods);
  ASSERT_EQ(periods.size(), 2U);
  EXPECT_NEAR(periods[0], 0.5 * kPitch, 1e-4);
  EXPECT_NEAR(periods[1], kPitch, 1e-4);
}

TEST_F(ForceBalance, FindsNothingInAMassAlone) {
  int alarms = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    record([](double, double) { return 0.0; }, 0.5, seed);
    const Diagnosis diagnosis = diagnose(*problem());
    alarms += diagnosis.detection.detected ? 1 : 0;
  }
  // At 5 %, four of twelve have a probability of 0.2 %.
  EXPECT_LT(alarms, 4);
}

TEST_F(ForceBalance, FindsNothingInNoiseThatFollowsItself) {
  int alarms = 0, laws = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    record([](double, double) { return 0.0; }, 0.5, seed, 0.9);
    const Diagnosis diagnosis = diagnose(*problem());
    alarms += diagnosis.detection.detected ? 1 : 0;
    laws += diagnosis.effects.empty() ? 0 : 1;
  }
  EXPECT_LT(alarms, 4);
  EXPECT_LT(laws, 2);
}

TEST_F(ForceBalance, FindsFrictionInNoiseThatFollowsItself) {
  record([](double, double v) { return 8.0 * std::tanh(v / 0.01); }, 1.0, 3, 0.9);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_EQ(named(*data, diagnosis.effects[0]).law, "coulomb");
  const LawParameterEstimate& level = diagnosis.effects[0].law.parameters.front();
  EXPECT_NEAR(level.value, 8.0, 4.0 * level.standard_error);
}

// A low-pass gives any noise a past. The verdict calls that no past, and that of noise which has a
// memory of its own one.
TEST_F(ForceBalance, DoesNotTakeTheLowPassForAPast) {
  for (const double memory : {0.0, 0.98}) {
    record([](double, double v) { return 3.0 * v; }, 1.0, 4, memory);
    std::ofstream(folder_ / "campaign.yaml", std::ios::app)
        << "preprocess:\n  - {kind: low_pass, frequency: 5}\n";
    const auto data = problem();
    const Diagnosis diagnosis = diagnose(*data);
    ASSERT_TRUE(diagnosis.autocorrelated_error.has_value());
    const double share = *diagnosis.autocorrelated_error / diagnosis.after.estimation.nrmse;
    if (memory == 0.0) {
      EXPECT_LT(share, 0.5);
    } else {
      EXPECT_GT(share, 0.7);
    }
  }
}

// Five samples to a period of the low-pass, but a thousand at least; the answer stays.
TEST_F(ForceBalance, ThinsWhatALowPassLeavesAndAnswersTheSame) {
  record([](double, double v) { return 15.0 * v; }, 0.5, 8);
  std::string campaign = testing::read_text(folder_ / "campaign.yaml");
  campaign = replaced(campaign, "  - {file: run_2.csv, role: validation}", "  - {file: run_2.csv}");
  const RigidRobotModel drive = load_rigid_robot(folder_ / "drive.yaml");
  double damping[2] = {0.0, 0.0};
  for (const bool is_filtered : {false, true}) {
    std::ofstream(folder_ / "campaign.yaml")
        << (is_filtered ? replaced(campaign, "experiments:",
                                   "preprocess:\n  - {kind: low_pass, frequency: 4}\nexperiments:")
                        : campaign);
    const ForceBalanceData data = load_force_balance_data(drive, read_campaign(folder_));
    // Two periods of 4 Hz less at each of four ends; every second sample.
    EXPECT_EQ(data.estimation.samples(), is_filtered ? 1400 : 3000);
    const Diagnosis diagnosis = diagnose(*problem());
    ASSERT_EQ(diagnosis.effects.size(), 1U);
    damping[is_filtered ? 1 : 0] = diagnosis.effects[0].law.parameters[0].value;
  }
  EXPECT_NEAR(damping[1], damping[0], 0.02 * damping[0]);
}

TEST(ColouredNoise, KnowsWhatSamplesOfAKnownMemoryAreWorth) {
  Random random(5);
  Eigen::VectorXd values(20000);
  double value = 0.0;
  for (double& each : values) each = value = 0.8 * value + random.normal();
  const ColouredNoise noise(values);
  // (1 + a)/(1 - a) = 9 samples to one.
  EXPECT_NEAR(noise.effective_samples(), 20000.0 / 9.0, 300.0);
  const Eigen::VectorXd draw = noise.draw(random);
  EXPECT_NEAR(draw.head(19999).dot(draw.tail(19999)) / draw.squaredNorm(), 0.8, 0.03);
  EXPECT_NEAR(draw.squaredNorm() / values.squaredNorm(), 1.0, 0.15);
}

TEST_F(ForceBalance, NamesFrictionWithItsParameters) {
  record([](double, double v) { return 30.0 * v + 8.0 * std::tanh(v / 0.01); }, 0.5, 5);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  // Friction with bristles too short to be seen is the same here: such twins may be named as well.
  EXPECT_NE(diagnosis.verdict, Verdict::kUnknown);
  EXPECT_NE(diagnosis.verdict, Verdict::kNone);
  ASSERT_EQ(diagnosis.effects.size(), 2U);
  for (const FoundEffect& effect : diagnosis.effects) {
    const LawParameterEstimate& level = effect.law.parameters.front();
    if (named(*data, effect).law == "viscous") {
      EXPECT_NEAR(level.value, 30.0, 4.0 * level.standard_error);
    } else {
      EXPECT_EQ(named(*data, effect).law, "coulomb");
      EXPECT_NEAR(level.value, 8.0, 4.0 * level.standard_error);
    }
    EXPECT_LT(level.standard_error, 1.0);
  }
  EXPECT_LT(diagnosis.validation_after->nrmse, 0.5 * diagnosis.validation_before->nrmse);
  ASSERT_EQ(diagnosis.pictures.size(), 2U);
  EXPECT_EQ(diagnosis.pictures[0].force.size(), 1500U);
}

// What a limit takes from the force is like friction: nothing is found in a mass alone, and a law
// that is there is found with its size.
TEST_F(ForceBalance, LeavesOutWhatWasClipped) {
  limit_ = 9.0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    record([](double, double) { return 0.0; }, 0.2, seed);
    const auto data = problem();
    const Diagnosis diagnosis = diagnose(*data);
    EXPECT_TRUE(diagnosis.effects.empty()) << seed;
    EXPECT_NE(diagnosis.verdict, Verdict::kExplained) << seed;
    ASSERT_FALSE(data->remarks().empty());
    EXPECT_NE(data->remarks()[0].find("flat tops"), std::string::npos) << data->remarks()[0];
  }
  record([](double, double v) { return 4.0 * std::tanh(v / 0.01); }, 0.2, 5);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_EQ(named(*data, diagnosis.effects[0]).law, "coulomb");
  const LawParameterEstimate& level = diagnosis.effects[0].law.parameters[0];
  EXPECT_NEAR(level.value, 4.0, 4.0 * level.standard_error);
  EXPECT_LT(level.standard_error, 0.4);
}

// A valve that is opened and closed for the fit and opened again, for recordings kept out: there
// the force of its friction hardly changes, and the error is as large as what changes.
TEST_F(ForceBalance, FindsFrictionThoughTheStrokeKeptOutGoesOneWay) {
  record([](double, double) { return 0.0; }, 0.1, 6);  // the campaign and its channels
  Random random(6);
  for (const auto& [name, strokes] : {std::pair{"run_1.csv", 2}, std::pair{"run_2.csv", 1}}) {
    std::ofstream file(folder_ / name);
    file << "force,x,v,a\n";
    double disturbance = 0.0;
    for (int k = 20; k < 200 * strokes - 20; ++k) {
      const double w = std::numbers::pi / 2.0, t = 0.01 * k;  // a stroke takes two seconds
      const double x = 0.2 * (1.0 - std::cos(w * t)), v = 0.2 * w * std::sin(w * t),
                   a = 0.2 * w * w * std::cos(w * t);
      disturbance = 0.9 * disturbance + std::sqrt(0.19) * 5.0 * random.normal();
      file << 12.0 * a + 60.0 * std::tanh(v / 0.01) + disturbance << ',' << x << ',' << v << ','
           << a << '\n';
    }
  }
  const Diagnosis diagnosis = diagnose(*problem());
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_EQ(named(*problem(), diagnosis.effects[0]).law, "coulomb");
  ASSERT_TRUE(diagnosis.validation_after.has_value());
  EXPECT_GT(diagnosis.validation_after->nrmse, 100.0) << "the case is too easy to test anything";
}

// Sixty samples do not tell thirty steps, and tell that friction is left.
TEST(RemainingStructure, FewSamplesTellFriction) {
  Random random(8);
  ForceBalanceRows rows;
  Motion motion;
  constexpr Eigen::Index kSamples = 60;
  motion.time = Eigen::VectorXd::LinSpaced(kSamples, 0.0, 5.9);
  motion.position = (0.9 * motion.time).array().sin().matrix();
  motion.velocity = 0.9 * (0.9 * motion.time).array().cos().matrix();
  rows.measured = motion.velocity.array().sign().matrix();
  for (Eigen::Index k = 0; k < kSamples; ++k) rows.measured(k, 0) += 0.3 * random.normal();
  rows.pieces.push_back(motion);
  EXPECT_GT(remaining_structure(rows, rows.measured), 0.8);
  Eigen::MatrixXd noise(kSamples, 1);
  for (Eigen::Index k = 0; k < kSamples; ++k) noise(k, 0) = random.normal();
  EXPECT_LT(remaining_structure(rows, noise), 0.1);
}

TEST_F(ForceBalance, WithoutItsLawTheRestIsUnknown) {
  record([](double, double v) { return 8.0 * std::tanh(v / 0.01); }, 0.5, 6);
  SearchOptions options;
  for (const LawEntry& entry : law_catalogue()) {
    const bool has_friction = entry.name != "stiffness" && entry.name != "offset" &&
                              entry.name != "viscous" && entry.name != "cubic_spring";
    if (has_friction && entry.use == LawUse::kForce) options.excluded_laws.push_back(entry.name);
  }
  const Diagnosis diagnosis = diagnose(*problem(), options);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  ASSERT_TRUE(diagnosis.remaining_structure.has_value());
  EXPECT_GT(*diagnosis.remaining_structure, 0.2);
}

// Of several harmonics alike each by itself predicts little: what it gains drowns in the others.
TEST_F(ForceBalance, FindsHarmonicsThatHideEachOther) {
  const std::vector<double> periods{0.31, 0.23, 0.17, 0.13, 0.11};
  record(
      [&](double x, double) {
        double force = 0.0;
        for (const double period : periods) {
          force += 4.0 * std::sin(2.0 * std::numbers::pi * x / period + 7.0 * period);
        }
        return force;
      },
      0.5, 8);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  for (const double period : periods) {
    EXPECT_TRUE(std::ranges::any_of(diagnosis.effects, [&](const FoundEffect& effect) {
      const auto& parameters = effect.law.parameters;
      return named(*data, effect).law == "ripple" &&
             std::abs(parameters[1].value / period - 1.0) < 0.02 &&
             std::abs(parameters[0].value - 4.0) < 0.4;
    })) << period;
  }
}

// No sensor errs by half of what it measures for seconds on end. What it is, such recordings do not
// tell.
TEST_F(ForceBalance, CallsARestThatFollowsItselfNoNoise) {
  record([](double, double) { return 0.0; }, 6.0, 9, 0.99);
  const Diagnosis slow = diagnose(*problem());
  EXPECT_EQ(slow.verdict, Verdict::kUnknown);
  ASSERT_TRUE(slow.autocorrelated_error.has_value());
  EXPECT_GT(*slow.autocorrelated_error, 10.0);
  record([](double, double) { return 0.0; }, 6.0, 9, 0.0);
  const Diagnosis white = diagnose(*problem());
  EXPECT_EQ(white.verdict, Verdict::kNone);
  EXPECT_LT(*white.autocorrelated_error, 5.0);
  EXPECT_GT(white.after.estimation.nrmse, 40.0);
}

TEST_F(ForceBalance, FindsPlayInASpring) {
  record([](double x, double) { return 500.0 * (x - std::clamp(x, -0.05, 0.05)); }, 0.5, 7);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_FALSE(diagnosis.effects.empty());
  // A spring behind a clearance, or a spring and the play that takes it away: the same force.
  EXPECT_LT(diagnosis.validation_after->nrmse, 1.2 * 0.5 / 12.0 * 100.0);
  EXPECT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_EQ(named(*data, diagnosis.effects[0]).law, "dead_zone");
}

TEST(LawForce, FollowsABristleOfAnyStiffnessUnderConstantVelocity) {
  // Dahl: x' = z' (1 - x sign(z') s/F): x(t) = F/s (1 - exp(-s z/F)) from rest.
  const LawEntry& entry = *find_law("dahl", false);
  RecordedPlaceMotion motion;
  motion.time = Eigen::VectorXd::LinSpaced(200, 0.0, 1.0);
  motion.deflection = 0.4 * motion.time;
  motion.rate = Eigen::VectorXd::Constant(200, 0.4);
  motion.acceleration = Eigen::VectorXd::Zero(200);
  for (const double stiffness : {10.0, 1e3, 1e6}) {
    const std::vector<double> parameters{stiffness, 2.0};
    const Eigen::VectorXd force = law_force(*entry.make(parameters), motion);
    for (Eigen::Index k = 0; k < 200; ++k) {
      EXPECT_NEAR(force(k), 2.0 * (1.0 - std::exp(-stiffness * motion.deflection(k) / 2.0)), 1e-6);
    }
  }
}

// Dahl's friction in closed form: towards the level of the direction by e^(-stiffness |dx| /
// level).
class Bristle {
 public:
  double operator()(double x, double) {
    if (std::abs(x - last_) > 0.1) {  // another recording
      force_ = 0.0;
      last_ = x;
    }
    const double level = x > last_ ? kLevel : -kLevel;
    force_ = level - (level - force_) * std::exp(-kStiffness * std::abs(x - last_) / kLevel);
    last_ = x;
    return force_;
  }
  static constexpr double kStiffness = 400.0, kLevel = 10.0;

 private:
  double last_ = 1e9, force_ = 0.0;
};

// The model with what was found is a model like any other, also where that remembers.
TEST_F(ForceBalance, ReadsBackTheModelThatItExtendedByALawWithMemory) {
  record(Bristle(), 0.2, 12);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_EQ(named(*data, diagnosis.effects[0]).law, "dahl");
  const fs::path extended = folder_ / "extended.yaml";
  std::ofstream(extended) << extended_model_text(folder_ / "drive.yaml", extended, diagnosis.after,
                                                 data->hypotheses());
  const auto again = force_balance_problem(extended, read_campaign(folder_));
  const ExtendedFit fit = again->fit({}, nullptr);
  EXPECT_NEAR(fit.estimation.nrmse, diagnosis.after.estimation.nrmse,
              1e-3 * diagnosis.after.estimation.nrmse);
  EXPECT_NEAR(again->validate(fit)->nrmse, diagnosis.validation_after->nrmse,
              1e-3 * diagnosis.validation_after->nrmse);
  EXPECT_EQ(diagnose(*again).verdict, Verdict::kNone);
}

// Known or refined, from the catalogue or of one's own, the bristle leaves the mass as it is.
TEST_F(ForceBalance, FitsAMassBesideALawWithMemory) {
  record(Bristle(), 0.2, 12);
  std::ifstream drive(folder_ / "drive.yaml");
  const std::string text{std::istreambuf_iterator<char>(drive), {}};
  const std::string own_law = R"(laws:
  - {name: fading_friction, description: one state, states: {s: v * (1 - s * sign(v) / reach)},
     force: level * s / reach, parameters: {level: {unit: F, range: positive},
     reach: {unit: x, range: positive, tried: deflection}}}
)";
  const std::string bristle =
      "elements:\n  - {name: bristle, location: {kind: element, joint: carriage, axis: arm}, law: ";
  struct Case {
    std::string rest;
    std::vector<double> truth;
  };
  for (const Case& each : {
           Case{bristle + "dahl, parameters: {stiffness: {value: 400, unit: N/m}, level: {value: "
                          "10, unit: N}}}\n",
                {12.0}},
           Case{bristle + "dahl, parameters: {stiffness: {value: 300, unit: N/m}, level: {value: "
                          "10, unit: N}}}\nrefine: [bristle.stiffness, bristle.level]\n",
                {12.0, Bristle::kStiffness, Bristle::kLevel}},
           Case{own_law + bristle +
                    "fading_friction, parameters: {level: {value: 8, unit: N}, reach: {value: "
                    "0.03, unit: m}}}\nrefine: [bristle.level, bristle.reach]\n",
                {12.0, Bristle::kLevel, Bristle::kLevel / Bristle::kStiffness}},
       }) {
    const fs::path file = folder_ / "stuck.yaml";
    std::ofstream(file) << text << each.rest;
    const RigidRobotModel robot = load_rigid_robot(file);
    const InverseDynamicsFit fit =
        fit_inverse_dynamics(robot, read_motion_records(robot, read_campaign(folder_)), {});
    EXPECT_EQ(fit.status, InverseDynamicsStatus::kConverged);
    ASSERT_EQ(fit.parameters.size(), each.truth.size());
    for (std::size_t p = 0; p < fit.parameters.size(); ++p) {
      const double error =
          std::sqrt(fit.covariance(static_cast<Eigen::Index>(p), static_cast<Eigen::Index>(p)));
      EXPECT_NEAR(fit.parameters[p].value, each.truth[p], 4.0 * error) << fit.parameters[p].name;
      EXPECT_LT(error, 0.03 * each.truth[p]) << fit.parameters[p].name;
    }
  }
}

// A vertical axis and two that lift, with known bodies.
const std::string kLiftingArm = R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints:
  - {name: waist, alpha: 0, a: 0, d: 0.3, gear_ratio: 1, rotor_inertia: 0,
     body: {mass: 5, centre_of_mass: [0, 0.01, 0.1]}}
  - {name: shoulder, alpha: -90, a: 0, d: 0, gear_ratio: 1, rotor_inertia: 0,
     body: {mass: 4, centre_of_mass: [0.2, 0, 0.02]}}
  - {name: elbow, alpha: 0, a: 0.4, d: 0, gear_ratio: 1, rotor_inertia: 0,
     body: {mass: 3, centre_of_mass: [0.1, 0, 0]}}
channels:
  torque: [t_1, t_2, t_3]
  torque_of: arm
  position: [q_1, q_2, q_3]
  position_of: arm
  velocity: [v_1, v_2, v_3]
  acceleration: [a_1, a_2, a_3]
)";
const std::string kOffsetLoad = R"(elements:
  - {name: load, location: {kind: element, axis: flange}, law: payload,
     parameters: {mass: {value: 2, unit: kg}, x: {value: 0.15, unit: m},
                  y: {value: -0.05, unit: m}, z: {value: 0.1, unit: m}}}
known: [load.mass]
)";

std::ofstream arm_recording(const fs::path& file) {
  std::ofstream stream(file);
  stream.precision(12);
  stream << "t_1,t_2,t_3,q_1,q_2,q_3,v_1,v_2,v_3,a_1,a_2,a_3\n";
  return stream;
}

void write_sample(std::ostream& stream, const Eigen::Vector3d& torque, const Eigen::Vector3d& q,
                  const Eigen::Vector3d& v, const Eigen::Vector3d& a) {
  stream << torque(0) << ',' << torque(1) << ',' << torque(2);
  for (const Eigen::Vector3d* signal : {&q, &v, &a}) {
    for (const double value : *signal) stream << ',' << value;
  }
  stream << '\n';
}

// `drives`: recorded units of each joint's torque per N m. `memory`: correlation of the noise from
// sample to sample.
void write_arm(const fs::path& file, const RigidRobotModel& robot, double phase, Random& random,
               const std::string& load = "",
               const Eigen::Vector3d& drives = Eigen::Vector3d::Ones(), double memory = 0.0) {
  TorqueColumns columns(robot);
  columns.carry(load);
  std::ofstream stream = arm_recording(file);
  Eigen::Vector3d noise = Eigen::Vector3d::Zero();
  for (int k = 0; k < 1500; ++k) {
    Eigen::Vector3d q = Eigen::Vector3d::Zero(), v = q, a = q;
    for (Eigen::Index j = 0; j < 3; ++j) {
      for (const double w : {0.9 + 0.2 * static_cast<double>(j), 2.7}) {
        const double angle = 0.01 * w * k + phase + 1.7 * static_cast<double>(j);
        q(j) += 0.5 * std::sin(angle);
        v(j) += 0.5 * w * std::cos(angle);
        a(j) -= 0.5 * w * w * std::sin(angle);
      }
    }
    columns.evaluate(q, v, a);
    const Eigen::Vector3d innovation(random.normal(), random.normal(), random.normal());
    noise = memory * noise + std::sqrt(1.0 - memory * memory) * innovation;
    const Eigen::Vector3d torque = (columns.known() + 0.3 * noise).cwiseProduct(drives);
    write_sample(stream, torque, q, v, a);
  }
}

void write_arm_campaign(const fs::path& file, const std::string& experiments) {
  std::ofstream campaign(file);
  campaign << "format: graybox-campaign/1\nsample_time: 0.01\nchannels:\n";
  for (const char* unit :
       {"t_:N m:input", "q_:rad:output", "v_:rad/s:output", "a_:rad/s^2:output"}) {
    const std::string text = unit;
    const std::size_t first = text.find(':'), second = text.rfind(':');
    for (int j = 1; j <= 3; ++j) {
      campaign << "  - {name: " << text.substr(0, first) << j
               << ", unit: " << text.substr(first + 1, second - first - 1)
               << ", is: " << text.substr(second + 1) << "}\n";
    }
  }
  campaign << "experiments:\n" << experiments;
}

// Model and campaign of the lifting arm, its recordings still to be written: 1.csv and 2.csv.
TorqueColumns lifting_arm_of_two_runs(const fs::path& folder) {
  std::ofstream(folder / "drive.yaml") << kLiftingArm;
  write_arm_campaign(folder / "campaign.yaml",
                     "  - {file: 1.csv}\n  - {file: 2.csv, role: validation}\n");
  return TorqueColumns(load_rigid_robot(folder / "drive.yaml"));
}

// Two recordings of an arm that moves as `truth` says, the second kept out, and the model for them.
void record_arm(const fs::path& folder, const std::string& truth, const std::string& model,
                const Eigen::Vector3d& drives = Eigen::Vector3d::Ones(), std::uint64_t seed = 5,
                double memory = 0.0) {
  std::ofstream(folder / "truth.yaml") << truth;
  std::ofstream(folder / "drive.yaml") << model;
  write_arm_campaign(folder / "campaign.yaml",
                     "  - {file: 1.csv}\n  - {file: 2.csv, role: validation}\n");
  Random random(seed);
  const RigidRobotModel robot = load_rigid_robot(folder / "truth.yaml");
  write_arm(folder / "1.csv", robot, 0.0, random, "", drives, memory);
  write_arm(folder / "2.csv", robot, 0.8, random, "", drives, memory);
}

std::string names_of(const MismatchProblem& problem, const Diagnosis& diagnosis) {
  std::string names;
  for (const FoundEffect& effect : diagnosis.effects) {
    const Hypothesis& found = problem.hypotheses()[effect.law.hypothesis];
    names += found.law + " at " + found.place + "; ";
  }
  return names;
}

// The load of kOffsetLoad, each of its numbers within four errors, none above `largest_error`.
void expect_offset_load(const FittedLaw& law, double largest_error) {
  const double expected[] = {2.0, 0.15, -0.05, 0.1};
  for (std::size_t i = 0; i < 4; ++i) {
    const LawParameterEstimate& each = law.parameters[i];
    EXPECT_GT(each.standard_error, 0.0) << each.name;
    EXPECT_LT(each.standard_error, largest_error) << each.name;
    EXPECT_NEAR(each.value, expected[i], 4.0 * each.standard_error) << each.name;
  }
}

TEST_F(ForceBalance, FindsAPayloadAndWhereItIs) {
  record_arm(folder_, kLiftingArm + kOffsetLoad, kLiftingArm);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_EQ(named(*data, diagnosis.effects[0]).law, "payload");
  expect_offset_load(diagnosis.effects[0].law, 0.02);
  EXPECT_FALSE(diagnosis.doubted_model.has_value()) << "one payload is the plainer explanation";
}

// How the rate in docs/explanation/force_balance.md was measured: GRAYBOX_TEST_RUNS of each.
TEST_F(ForceBalance, FindsNothingInAnArmThatIsWhole) {
  const char* given = std::getenv("GRAYBOX_TEST_RUNS");
  const int runs = given != nullptr ? std::atoi(given) : 3;
  int with_laws = 0, freed = 0;
  for (const double memory : {0.0, 0.9, 0.98}) {
    for (int run = 0; run < runs; ++run) {
      record_arm(folder_, kLiftingArm, kLiftingArm, Eigen::Vector3d::Ones(),
                 static_cast<std::uint64_t>(1000 * run + 7), memory);
      const auto data = problem();
      const Diagnosis diagnosis = diagnose(*data);
      freed += diagnosis.freed_model || diagnosis.doubted_model ? 1 : 0;
      if (diagnosis.effects.empty()) continue;
      ++with_laws;
      std::cout << "memory " << memory << ": " << names_of(*data, diagnosis) << '\n';
    }
  }
  std::cout << with_laws << " of " << 3 * runs << " with a false law\n";
  EXPECT_LE(20 * with_laws, 3 * runs + 20);
  EXPECT_EQ(freed, 0) << "bodies that are as stated were said to be off";
}

// Stated as certain, they are not freed, but what they are off by is told.
TEST_F(ForceBalance, DoubtsBodiesThatAreStatedAndNotSo) {
  const std::string heavier =
      replaced(kLiftingArm, "mass: 4, centre_of_mass: [0.2,", "mass: 4.8, centre_of_mass: [0.22,");
  record_arm(folder_, heavier, kLiftingArm);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  EXPECT_FALSE(diagnosis.freed_model.has_value());
  ASSERT_TRUE(diagnosis.doubted_model.has_value()) << names_of(*data, diagnosis);
  const FreedModel& doubted = *diagnosis.doubted_model;
  EXPECT_TRUE(doubted.on_kept_out);
  EXPECT_LT(doubted.error_freed, 0.8 * doubted.error_stated);
  EXPECT_GE(doubted.instead_of.size(), 2U) << "a payload and inertias stood in for the body";
  ASSERT_FALSE(doubted.departures.empty());
}

// Links that weigh more and whose mass sits elsewhere than the drawing says: no law, but bodies.
TEST_F(ForceBalance, FreesBodiesThatAreNotAsStated) {
  const std::string heavier = replaced(
      replaced(kLiftingArm, "mass: 4, centre_of_mass: [0.2,", "mass: 4.5, centre_of_mass: [0.22,"),
      "mass: 3, centre_of_mass: [0.1, 0,", "mass: 2.8, centre_of_mass: [0.09, 0.005,");
  record_arm(folder_, heavier, kLiftingArm + "body_uncertainty: 0.1\n");
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_TRUE(diagnosis.freed_model.has_value());
  EXPECT_LT(diagnosis.freed_model->error_freed, 1.02 * diagnosis.freed_model->error_stated);
  EXPECT_TRUE(diagnosis.effects.empty()) << names_of(*data, diagnosis);
  ASSERT_FALSE(diagnosis.freed_model->departures.empty());
  // 4.5 kg at 0.22 m and what the elbow holds 0.4 m out: the static moment about the shoulder.
  double moment = 4.0 * 0.2 + 3.0 * 0.4, variance = 0.0;
  for (const LawParameterEstimate& each : diagnosis.after.model_parameters) {
    if (each.name == "MX departure of shoulder") moment += each.value;
    if (each.name == "M departure of elbow") moment += 0.4 * each.value;
    if (each.name == "MX departure of shoulder") variance = std::pow(each.standard_error, 2);
  }
  EXPECT_NEAR(moment, 4.5 * 0.22 + 2.8 * 0.4, 4.0 * std::sqrt(variance));
  EXPECT_NEAR(moment, 4.5 * 0.22 + 2.8 * 0.4, 0.03);
  EXPECT_EQ(excluding(diagnosis.implausible), 0U);
}

// Drives that report currents: each joint has departures over its gain. What is told of a body and
// of a gain together is what the joint feels: the static moment about the shoulder.
TEST_F(ForceBalance, FreesBodiesWhereDriveGainsAreUnknown) {
  const std::string heavier = replaced(
      replaced(kLiftingArm, "mass: 4, centre_of_mass: [0.2,", "mass: 4.5, centre_of_mass: [0.22,"),
      "mass: 3, centre_of_mass: [0.1, 0,", "mass: 2.8, centre_of_mass: [0.09, 0.005,");
  const Eigen::Vector3d drives(0.5, 0.2, 2.0);
  record_arm(folder_, heavier, kLiftingArm + "  drive_gains: unknown\nbody_uncertainty: 0.1\n",
             drives);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_TRUE(diagnosis.freed_model.has_value());
  EXPECT_LT(diagnosis.freed_model->error_freed, 1.02 * diagnosis.freed_model->error_stated);
  EXPECT_TRUE(diagnosis.effects.empty()) << names_of(*data, diagnosis);
  ASSERT_FALSE(diagnosis.freed_model->departures.empty());
  double moment = 0.0;
  for (const LawParameterEstimate& each : diagnosis.after.model_parameters) {
    if (each.name == "1/gain_2") moment += (4.0 * 0.2 + 3.0 * 0.4) * each.value;
    if (each.name == "MX departure of shoulder over gain_2") moment += each.value;
    if (each.name == "M departure of elbow over gain_2") moment += 0.4 * each.value;
  }
  EXPECT_NEAR(moment, drives(1) * (4.5 * 0.22 + 2.8 * 0.4), 0.03 * drives(1));
}

// The gate sees bodies as they were fitted: this one's centre of mass lies outside of it.
TEST_F(ForceBalance, TellsBodiesThatCanNotExist) {
  record_arm(folder_, kLiftingArm, kLiftingArm + "body_uncertainty: 0.1\n");
  const auto stated = problem();
  const auto freed = stated->with_uncertain_model(stated->fit({}, nullptr));
  ASSERT_NE(freed, nullptr);
  ExtendedFit fit = freed->fit({}, nullptr);
  const auto flaws = [&] { return implausibilities(fit_physics(*freed, fit)); };
  EXPECT_TRUE(flaws().empty());
  for (LawParameterEstimate& each : fit.model_parameters) {
    if (each.name != "MX departure of shoulder") continue;
    each.value = 40.0;  // kg m, of a body of 4 kg
    each.standard_error = 0.5;
  }
  const std::vector<Implausibility> found = flaws();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].rule, PlausibilityRule::kBody);
  EXPECT_EQ(found[0].quantity, "shoulder's link");
  EXPECT_TRUE(found[0].excludes);
  EXPECT_GT(found[0].standard_errors, 20.0);
  EXPECT_LT(found[0].standard_errors, 80.0);  // of the way back to what is stated
}

// A weight may make a joint topple as a spring of negative stiffness does, but not beyond a gap.
TEST(FitPhysics, KnowsNoSpringThatPushesBeyondAClearance) {
  for (const char* const law : {"dead_zone", "stiffness"}) {
    const std::vector<Hypothesis> hypotheses{{"axis.arm", "", law, {}}};
    ExtendedFit fit;
    fit.usable = true;
    FittedLaw& found = fit.laws.emplace_back();
    if (std::string_view(law) == "dead_zone") {
      found.parameters.push_back({"clearance", "rad", 0.4, 0.01});
    }
    found.parameters.push_back({"stiffness", "N m/rad", -0.0227, 0.0018});
    const auto flaws = implausibilities(fit_physics(hypotheses, {}, fit));
    EXPECT_EQ(excluding(flaws), std::string_view(law) == "dead_zone" ? 1U : 0U) << law;
  }
}

TEST_F(ForceBalance, KeepsBodiesOfWhichNoUncertaintyIsStated) {
  const std::string heavier =
      replaced(kLiftingArm, "mass: 4, centre_of_mass: [0.2,", "mass: 4.5, centre_of_mass: [0.22,");
  record_arm(folder_, heavier, kLiftingArm);
  EXPECT_FALSE(diagnose(*problem()).freed_model.has_value());
  std::ofstream(folder_ / "drive.yaml") << kLiftingArm + "body_uncertainty: 20\n";
  try {
    (void)problem();
    FAIL() << "a share of 20";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("body_uncertainty: is a share"), std::string::npos)
        << error.what();
  }
}

// Against the closed form of least squares with a prior, noise as it was found.
TEST(BalanceRegression, WeighsAPriorAsRowsOfItsOwn) {
  constexpr Eigen::Index kSamples = 300;
  ForceBalanceRows rows;
  Random random(4);
  Eigen::MatrixXd columns(kSamples, 3);
  for (double& value : columns.reshaped()) value = random.normal();
  columns.col(2) = columns.col(0) + 1e-3 * columns.col(2);  // told apart by the prior alone
  const Eigen::Vector3d truth(1.0, -2.0, 0.5);
  Eigen::VectorXd force = columns * truth;
  for (double& value : force) value += 0.3 * random.normal();
  rows.measured = rows.force = force;
  rows.model = {{columns}, 3};
  rows.model_precision = Eigen::Vector3d(0.0, 4.0, 100.0);
  rows.pieces.resize(1);
  rows.pieces[0].time = Eigen::VectorXd::LinSpaced(kSamples, 0.0, 3.0);
  rows.names = {"one"};
  const BalanceFit fit = BalanceRegression(rows).fit({});
  ASSERT_TRUE(fit.full_rank);
  const double weight = 1.0 / (fit.noise(0) * fit.noise(0));
  const Eigen::Matrix3d normal =
      weight * columns.transpose() * columns + Eigen::Matrix3d(rows.model_precision.asDiagonal());
  const Eigen::Vector3d expected = normal.ldlt().solve(weight * columns.transpose() * force);
  EXPECT_LT((fit.model - expected).norm(), 1e-4 * expected.norm());
  EXPECT_NEAR(fit.noise(0), 0.3, 0.05);
}

// What is kept is what would be computed, for whatever key comes next.
TEST(LawSampleCache, GivesEachKeyItsOwn) {
  LawSampleCache cache(1 << 20);  // so large that few fit
  const int place = 0, law = 0;
  int computed = 0;
  const auto ask = [&](double parameter) {
    return (*cache.get({&place, &law, {parameter}}, [&] {
      ++computed;
      return Eigen::VectorXd::Constant(2, parameter).eval();
    }))(1);
  };
  for (int round = 0; round < 3; ++round) {
    for (int k = 0; k < 500; ++k) EXPECT_EQ(ask(k), k);
  }
  EXPECT_EQ(ask(499.0), 499.0);
  EXPECT_EQ(computed > 500, true);
  const int before = computed;
  EXPECT_EQ(ask(499.0), 499.0);
  EXPECT_EQ(computed, before);
}

// What holds the shoulder up is as strong as the load. A payload that spares the shoulder its
// counterbalance suits no other joint.
TEST_F(ForceBalance, FindsAPayloadBesideACounterbalance) {
  const std::string counterbalance = R"(
  - {name: spring, location: {kind: element, joint: shoulder, axis: arm}, law: stiffness,
     parameters: {stiffness: {value: 40, unit: N m/rad}}}
  - {name: preload, location: {kind: element, joint: shoulder, axis: arm}, law: offset,
     parameters: {value: {value: 15, unit: N m}}}
known: [spring.stiffness, preload.value, )";
  record_arm(folder_, kLiftingArm + replaced(kOffsetLoad, "\nknown: [", counterbalance),
             kLiftingArm);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  EXPECT_EQ(diagnosis.effects.size(), 3U) << names_of(*data, diagnosis);
  const auto payload = std::ranges::find_if(diagnosis.effects, [&](const FoundEffect& effect) {
    return named(*data, effect).law == "payload";
  });
  ASSERT_NE(payload, diagnosis.effects.end()) << names_of(*data, diagnosis);
  expect_offset_load(payload->law, 0.05);
}

// Two forces of one parameter: 2 by the first, 5 by the second, which is ten times less noisy.
// Equal weights lead to the first, where the second is off by 3; the other way is more likely.
TEST(BalanceRegression, TakesTheMostLikelyNoiseOfSeveral) {
  constexpr Eigen::Index kSamples = 400;
  ForceBalanceRows rows;
  Random random(3);
  BalanceColumns column{{Eigen::MatrixXd(kSamples, 1), Eigen::MatrixXd(kSamples, 1)}, 1};
  rows.force.resize(kSamples, 2);
  Motion& piece = rows.pieces.emplace_back();
  piece.time = Eigen::VectorXd::LinSpaced(kSamples, 0.0, 4.0);
  for (Eigen::Index t = 0; t < kSamples; ++t) {
    const double x = std::sin(0.1 * static_cast<double>(t));
    column.in[0](t, 0) = column.in[1](t, 0) = x;
    rows.force(t, 0) = 2.0 * x + 0.1 * random.normal();
    rows.force(t, 1) = 5.0 * x + 0.01 * random.normal();
  }
  rows.measured = rows.force;
  rows.model = {{Eigen::MatrixXd(kSamples, 0), Eigen::MatrixXd(kSamples, 0)}, 0};
  const BalanceFit fit = BalanceRegression(rows).fit({&column, 1});
  ASSERT_TRUE(fit.full_rank);
  EXPECT_NEAR(fit.amplitudes(0), 5.0, 0.01);
  EXPECT_NEAR(fit.noise(1), 0.01, 0.002);
  EXPECT_NEAR(fit.noise(0), 3.0 * std::sqrt(0.5), 0.1);
}

TEST_F(ForceBalance, FindsFrictionBesideAPayloadOfTheModel) {
  const std::string friction =
      R"(  - {name: friction, location: {kind: element, joint: elbow, axis: arm}, law: viscous,
     parameters: {damping: {value: 2, unit: N m s/rad}}}
known: [)";
  const std::string truth_text =
      kLiftingArm + replaced(kOffsetLoad, "known: [", friction + "friction.damping, ");
  record_arm(folder_, truth_text, kLiftingArm + replaced(kOffsetLoad, "value: 2", "value: 1"));
  const auto data = problem();
  EXPECT_NE(names_of(*data, diagnose(*data)).find("viscous at elbow.arm; "), std::string::npos);
}

// A single joint of an arm moves, with a pause in which friction holds what it must; the others
// stand, and their drives give what friction left of the weights.
TEST_F(ForceBalance, TakesNothingFromWhatStandsStill) {
  TorqueColumns columns = lifting_arm_of_two_runs(folder_);
  Random random(5);
  for (int run = 1; run <= 2; ++run) {
    std::ofstream stream = arm_recording(folder_ / fmt::format("{}.csv", run));
    for (int k = 0; k < 2000; ++k) {
      const bool is_pause = k >= 700 && k < 1100;
      const double w = 1.3 + 0.2 * run, t = 0.01 * (k < 700 ? k : std::max(k - 400, 700));
      Eigen::Vector3d q(0.3, 0.9 * std::sin(w * t), -0.5), v = Eigen::Vector3d::Zero(), a = v;
      if (!is_pause) {
        v(1) = 0.9 * w * std::cos(w * t);
        a(1) = -0.9 * w * w * std::sin(w * t);
      }
      columns.evaluate(q, v, a);
      Eigen::Vector3d torque = columns.known();
      torque(1) += is_pause ? 1.9 : 2.0 * std::tanh(v(1) / 0.01);
      for (int j = 0; j < 3; ++j) torque(j) += 0.05 * random.normal();
      torque(2) += k < 1000 ? 4.0 : -3.0;  // held by friction
      write_sample(stream, torque, q, v, a);
    }
  }
  const auto data = problem();
  EXPECT_EQ(data->remarks().size(), 4U);  // two pauses, two joints
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_EQ(named(*data, diagnosis.effects[0]).law, "coulomb");
  EXPECT_EQ(named(*data, diagnosis.effects[0]).place, "shoulder.arm");
  const LawParameterEstimate& level = diagnosis.effects[0].law.parameters[0];
  EXPECT_NEAR(level.value, 2.0, 4.0 * level.standard_error);
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained);
}

// One joint rests while the others go on: what friction holds there is no law, and what the others
// show is.
TEST_F(ForceBalance, LeavesOutTheForceOfOneJointThatRests) {
  TorqueColumns columns = lifting_arm_of_two_runs(folder_);
  Random random(5);
  for (int run = 1; run <= 2; ++run) {
    std::ofstream stream = arm_recording(folder_ / fmt::format("{}.csv", run));
    for (int k = 0; k < 2000; ++k) {
      const bool rests = k >= 600 && k < 1400;
      const double own_time = 0.01 * (k < 600 ? k : std::max(k - 800, 600));
      Eigen::Vector3d q = Eigen::Vector3d::Zero(), v = q, a = q;
      for (int j = 0; j < 3; ++j) {
        const double w = 1.1 + 0.3 * j + 0.2 * run, t = j == 2 ? own_time : 0.01 * k;
        const double moves = j == 2 && rests ? 0.0 : 1.0;
        q(j) = 0.8 * std::sin(w * t);
        v(j) = moves * 0.8 * w * std::cos(w * t);
        a(j) = -moves * 0.8 * w * w * std::sin(w * t);
      }
      columns.evaluate(q, v, a);
      Eigen::Vector3d torque = columns.known();
      for (int j = 0; j < 3; ++j) torque(j) += 0.05 * random.normal();
      torque(2) += rests ? 1.9 * std::sin(0.02 * k) : 2.0 * std::tanh(v(2) / 0.01);
      write_sample(stream, torque, q, v, a);
    }
  }
  const auto data = problem();
  ASSERT_EQ(data->remarks().size(), 2U);
  EXPECT_NE(data->remarks()[0].find("these joints stand still: elbow 8"), std::string::npos)
      << data->remarks()[0];
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_EQ(names_of(*data, diagnosis), "coulomb at elbow.arm; ");
  const LawParameterEstimate& level = diagnosis.effects[0].law.parameters[0];
  EXPECT_NEAR(level.value, 2.0, 4.0 * level.standard_error);
  EXPECT_LT(level.standard_error, 0.02);
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained);
}

// Currents, 7, 11 and 23 N m for one of their units.
const Eigen::Vector3d kDrives(1.0 / 7.0, 1.0 / 11.0, 1.0 / 23.0);
const std::string kInDriveUnits =
    replaced(kLiftingArm, "torque_of: arm", "torque_of: arm\n  drive_gains: unknown");

TEST_F(ForceBalance, FindsAPayloadThatEachDriveFeelsInAUnitOfItsOwn) {
  record_arm(folder_, kLiftingArm + kOffsetLoad, kInDriveUnits, kDrives);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_EQ(names_of(*data, diagnosis), "payload at flange; ");
  // Gains that the bodies tell leave less to know the mass by.
  expect_offset_load(diagnosis.effects[0].law, 0.2);
}

// A load of ten times the last link's weight, and a last joint about whose axis no body has weight:
// its drive's gain shows by the load alone.
TEST_F(ForceBalance, FindsAPayloadThatOutweighsTheLinksThatTellTheGains) {
  const auto with_light_elbow = [](const std::string& text) {
    return replaced(text, "body: {mass: 3, centre_of_mass: [0.1, 0, 0]}",
                    "body: {mass: 0.2, centre_of_mass: [0, 0, 0]}");
  };
  record_arm(folder_, with_light_elbow(kLiftingArm + kOffsetLoad), with_light_elbow(kInDriveUnits),
             kDrives);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_EQ(names_of(*data, diagnosis), "payload at flange; ");
  expect_offset_load(diagnosis.effects[0].law, 0.2);
  for (const ChannelRest& channel : data->channel_rests(diagnosis.after)) {
    ASSERT_TRUE(channel.held_out_nrmse.has_value());
    // The noise is 27 % of what the last joint carries; without a gain all of that would be left.
    EXPECT_LT(*channel.held_out_nrmse, 30.0) << channel.channel;
  }
  ASSERT_EQ(diagnosis.after.inverse_gains.size(), 3U);
  EXPECT_NEAR(diagnosis.after.inverse_gains[2], kDrives(2), 0.05 * kDrives(2));
}

// First without, then with the load: it is looked for in the recordings that carry it.
TEST_F(ForceBalance, FindsTheLoadOfSomeRecordings) {
  const std::string load = replaced(kOffsetLoad, "axis: flange", "axis: flange, load: tool");
  for (const bool has_gains : {true, false}) {
    const Eigen::Vector3d drives = has_gains ? Eigen::Vector3d::Ones() : kDrives;
    std::ofstream(folder_ / "truth.yaml") << kLiftingArm << load;
    std::ofstream(folder_ / "drive.yaml") << (has_gains ? kLiftingArm : kInDriveUnits);
    write_arm_campaign(folder_ / "campaign.yaml",
                       "  - {file: 1.csv}\n  - {file: 2.csv, load: tool}\n"
                       "  - {file: 3.csv, role: validation}\n"
                       "  - {file: 4.csv, load: tool, role: validation}\n");
    Random random(5);
    const RigidRobotModel truth = load_rigid_robot(folder_ / "truth.yaml");
    for (int k = 1; k <= 4; ++k) {
      write_arm(folder_ / fmt::format("{}.csv", k), truth, 0.4 * k, random,
                k % 2 == 0 ? "tool" : "", drives);
    }
    const auto data = problem();
    const Diagnosis diagnosis = diagnose(*data);
    ASSERT_EQ(names_of(*data, diagnosis), "payload at flange with load tool; ") << has_gains;
    expect_offset_load(diagnosis.effects[0].law, 0.03);
  }
}

// Whatever a load is called, the extended model can be read.
TEST_F(ForceBalance, QuotesTheNamesOfLoads) {
  std::ofstream(folder_ / "drive.yaml") << kLiftingArm;
  write_arm_campaign(folder_ / "campaign.yaml",
                     "  - {file: 1.csv}\n  - {file: 2.csv, load: \"2 kg: grey, {b}\"}\n");
  Random random(5);
  const RigidRobotModel robot = load_rigid_robot(folder_ / "drive.yaml");
  for (const char* file : {"1.csv", "2.csv"}) write_arm(folder_ / file, robot, 0.3, random);
  const auto data = problem();
  const auto loaded = std::ranges::find_if(data->hypotheses(), [](const Hypothesis& hypothesis) {
    return hypothesis.place == "flange with load 2 kg: grey, {b}";
  });
  ASSERT_NE(loaded, data->hypotheses().end());
  EXPECT_EQ(loaded->location, "{kind: element, axis: flange, load: \"2 kg: grey, {b}\"}");
}

// A lift that stands while the arm on it moves; an arm alone that stands is not its own measure.
TEST(Standstill, JointsOfOneKindAreComparedAndOthersWithWhatMoves) {
  Motion piece;
  piece.position = Eigen::MatrixXd::Constant(50, 3, 0.2);
  piece.position.col(1) = Eigen::VectorXd::LinSpaced(50, -1.0, 1.0);
  piece.position.col(2) = Eigen::VectorXd::LinSpaced(50, 0.0, 1e-4);
  const std::vector<Motion> pieces{piece};
  EXPECT_EQ(idle_joints(pieces, {true, false, false}), (std::vector<bool>{true, false, true}));
  piece.position = Eigen::MatrixXd::Constant(50, 1, 0.2);
  EXPECT_EQ(idle_joints(std::vector<Motion>{piece}, {false}), std::vector<bool>{false});
}

// Rounded to the steps of an encoder, a joint that rests flickers; one that turns round does not
// rest. The low-pass carries what was held into the samples beside it.
TEST(Standstill, IsToldByHowFarAJointGets) {
  Motion piece;
  const Eigen::Index samples = 1000;
  piece.time = Eigen::VectorXd::LinSpaced(samples, 0.0, 9.99);
  piece.position.resize(samples, 2);
  piece.velocity = Eigen::MatrixXd::Zero(samples, 2);
  piece.acceleration = piece.torque = piece.velocity;
  for (Eigen::Index t = 0; t < samples; ++t) {
    const double time = 0.01 * static_cast<double>(t);
    piece.position(t, 0) = 0.5 * std::sin(2.0 * time);
    piece.position(t, 1) = t < 400 ? 0.1 * time : 0.4 + (t % 2 == 0 ? 0.0 : 1e-4);
  }
  piece.filters = {{10.0, 4}};
  const Eigen::Vector2d speeds(0.7, 0.06);
  mark_standstill(piece, speeds);
  EXPECT_FALSE(piece.stands.col(0).any());
  EXPECT_FALSE(piece.stands.col(1).head(390).any());
  EXPECT_TRUE(piece.stands.col(1).tail(605).all());  // 0.05 s before it comes to rest
  EXPECT_EQ(moving_parts(piece).size(), 1U);         // the other goes on
}

// Positions of one sine with noise of a known size: what differences of the filtered noise have is
// what the formula says of the acceleration, and clean positions need no filter.
TEST(DerivativeNoise, ChoosesTheLowPassThatTheAccelerationNeeds) {
  Random random(7);
  const Eigen::Index samples = 4000;
  const double sample_time = 0.01, deviation = 1e-3;
  Eigen::VectorXd clean(samples), noise(samples);
  for (Eigen::Index t = 0; t < samples; ++t) {
    clean(t) = std::sin(2.0 * sample_time * static_cast<double>(t));
    noise(t) = deviation * random.normal();
  }
  const auto low_pass_of = [&](const Eigen::VectorXd& values) {
    const std::vector<MotionSamples> records{{values, sample_time, 2}};
    return low_pass_for_acceleration(records);
  };
  EXPECT_FALSE(low_pass_of(clean).has_value());
  EXPECT_FALSE(low_pass_of(noise).has_value());  // nothing moves
  const std::optional<double> frequency = low_pass_of(clean + noise);
  ASSERT_TRUE(frequency.has_value());
  const auto share_at = [&](double f) {
    const Eigen::VectorXd left = zero_phase_low_pass(noise, f * sample_time, 4);
    const Eigen::Index n = samples - 2;
    const Eigen::VectorXd acceleration =
        (left.tail(n) - 2.0 * left.segment(1, n) + left.head(n)) / (sample_time * sample_time);
    return acceleration.squaredNorm() / static_cast<double>(n) / 8.0;  // that of the sine: 4^2 / 2
  };
  EXPECT_LT(share_at(*frequency), 0.00075);  // above the sine all is noise
  EXPECT_GT(share_at(1.6 * *frequency), 0.0005);
  // The same of velocities, which are differentiated once, and have more noise.
  const Eigen::VectorXd loud = 20.0 * noise;
  const std::vector<MotionSamples> velocities{{clean + loud, sample_time, 1}};
  const std::optional<double> other = low_pass_for_acceleration(velocities);
  ASSERT_TRUE(other.has_value());
  const auto share_of_velocities_at = [&](double f) {
    const Eigen::VectorXd left = zero_phase_low_pass(loud, f * sample_time, 4);
    const Eigen::Index n = samples - 1;
    const Eigen::VectorXd acceleration = (left.tail(n) - left.head(n)) / sample_time;
    return acceleration.squaredNorm() / static_cast<double>(n) / 2.0;  // of the sine: 2^2 / 2
  };
  EXPECT_LT(share_of_velocities_at(*other), 0.00075);
  EXPECT_GT(share_of_velocities_at(1.6 * *other), 0.0005);
  // What moves up to 10 Hz keeps that, though its noise is more than 0.05 %.
  Eigen::VectorXd lively = clean;
  for (Eigen::Index t = 0; t < samples; ++t) {
    for (double f = 0.5; f < 10.0; f += 0.5) {
      const double wave = 2.0 * std::numbers::pi * f;
      lively(t) +=
          0.5 / (wave * wave) * std::sin(wave * sample_time * static_cast<double>(t) + 7.0 * f);
    }
  }
  const std::optional<double> high = low_pass_of(lively + 0.1 * noise);
  EXPECT_GT(high.value_or(100.0), 10.0);
}

// A force that was recorded 0.05 s late beside physics that is missing, and one that was not late:
// the laws found are those that are there, not what would stand in for the lateness.
TEST_F(ForceBalance, MovesAForceThatComesLate) {
  for (const int late : {0, 5}) {  // samples of 0.01 s
    record([](double x, double v) { return 30.0 * std::sin(4.0 * x) + 8.0 * std::tanh(v / 0.01); },
           0.2, 6);
    for (const char* name : {"run_1.csv", "run_2.csv"}) {
      std::ifstream in(folder_ / name);
      std::vector<std::string> lines;
      for (std::string line; std::getline(in, line);) lines.push_back(line);
      in.close();
      std::ofstream out(folder_ / name);
      out << lines[0] << '\n';
      for (std::size_t k = 1 + static_cast<std::size_t>(late); k < lines.size(); ++k) {
        const std::string& earlier = lines[k - static_cast<std::size_t>(late)];
        out << earlier.substr(0, earlier.find(',')) << lines[k].substr(lines[k].find(',')) << '\n';
      }
    }
    const auto data = problem();
    const Diagnosis diagnosis = diagnose(*data);
    ASSERT_EQ(diagnosis.channels_after.size(), 1U);
    EXPECT_FALSE(diagnosis.channels_after[0].late_by.has_value());
    const bool has_friction =
        std::ranges::any_of(diagnosis.effects, [&](const FoundEffect& effect) {
          return data->hypotheses()[effect.law.hypothesis].law == "coulomb";
        });
    EXPECT_TRUE(has_friction) << names_of(*data, diagnosis);
    ASSERT_EQ(diagnosis.late_channels.size(), late > 0 ? 1U : 0U);
    for (const LateChannel& channel : diagnosis.late_channels) {
      EXPECT_NEAR(channel.moved.seconds, 0.05, 0.005);
      EXPECT_LT(channel.error_after, 0.5 * channel.error_before);
    }
  }
}

// Where a mass moves at few frequencies, lateness looks like viscous friction of either sign, which
// hides it. GRAYBOX_TEST_RUNS draws of each.
TEST_F(ForceBalance, TellsLatenessFromViscousFriction) {
  const char* given = std::getenv("GRAYBOX_TEST_RUNS");
  const int runs = given != nullptr ? std::atoi(given) : 2;
  int false_alarms = 0, told = 0, named_right = 0;
  for (int run = 0; run < runs; ++run) {
    for (const double late : {-0.03, 0.0, 0.03}) {
      record([](double, double v) { return 4.0 * v + 2.0 * std::tanh(v / 0.01); }, 0.3,
             static_cast<std::uint64_t>(run + 1), 0.9, late);
      const auto data = problem();
      const Diagnosis diagnosis = diagnose(*data);
      const bool is_right =
          names_of(*data, diagnosis) == "viscous at carriage.arm; coulomb at carriage.arm; " ||
          names_of(*data, diagnosis) == "coulomb at carriage.arm; viscous at carriage.arm; ";
      named_right += is_right ? 1 : 0;
      if (late == 0.0) {
        false_alarms += diagnosis.late_channels.empty() ? 0 : 1;
      } else if (diagnosis.late_channels.size() == 1) {
        // The motion's lateness is the force's earliness.
        told += std::abs(diagnosis.late_channels[0].moved.seconds + late) < 0.006 ? 1 : 0;
      }
    }
  }
  std::printf("  %d of %d in time called late, %d of %d late told, laws right in %d of %d\n",
              false_alarms, runs, told, 2 * runs, named_right, 3 * runs);
  EXPECT_EQ(false_alarms, 0);
  EXPECT_GE(told, 2 * runs - runs / 5);
  EXPECT_GE(named_right, 3 * runs - runs / 5);
}

// The ends of a recording behind a low-pass are mostly what the filter guesses beyond them.
TEST_F(ForceBalance, LeavesOutTheEndsThatALowPassGuesses) {
  record([](double, double v) { return 4.0 * v; }, 0.0, 1);
  std::ofstream(folder_ / "campaign.yaml") << R"(format: graybox-campaign/1
sample_time: 0.01
channels:
  - {name: force, unit: N, is: input}
  - {name: x, unit: m, is: output}
preprocess:
  - {kind: low_pass, frequency: 8}
  - {kind: derivative, of: [x], name: [v]}
  - {kind: derivative, of: [v], name: [a]}
experiments:
  - {file: run_1.csv}
  - {file: run_2.csv, role: validation}
)";
  const RigidRobotModel drive = load_rigid_robot(folder_ / "drive.yaml");
  const auto records = read_motion_records(drive, read_campaign(folder_));
  ASSERT_EQ(records.size(), 2U);
  const Motion& motion = records[1].pieces.front();
  EXPECT_EQ(motion.samples(), 1500 - 2 * 25);  // two periods of 8 Hz at either end
  EXPECT_NEAR(motion.time(0), 0.25, 1e-12);
  double largest = 0.0;
  for (Eigen::Index t = 0; t < motion.samples(); ++t) {
    const double rest =
        motion.torque(t, 0) - 12.0 * motion.acceleration(t, 0) - 4.0 * motion.velocity(t, 0);
    largest = std::max(largest, std::abs(rest));
  }
  EXPECT_LT(largest, 0.1);  // of 12 N rms; at the ends it is 22 N
}

// One clock for the positions of all joints, 0.08 s behind: told once for all, and friction is
// found as it is.
TEST_F(ForceBalance, MovesAllJointsByOneClock) {
  TorqueColumns columns = lifting_arm_of_two_runs(folder_);
  Random random(6);
  const auto motion_at = [](double t, int run) {
    std::array<Eigen::Vector3d, 3> motion{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                                          Eigen::Vector3d::Zero()};
    for (int j = 0; j < 3; ++j) {
      for (const double w : {0.9 + 0.2 * j, 2.7 + 0.1 * run}) {
        motion[0](j) += 0.5 * std::sin(w * t + 1.7 * j);
        motion[1](j) += 0.5 * w * std::cos(w * t + 1.7 * j);
        motion[2](j) -= 0.5 * w * w * std::sin(w * t + 1.7 * j);
      }
    }
    return motion;
  };
  for (int run = 1; run <= 2; ++run) {
    std::ofstream stream = arm_recording(folder_ / fmt::format("{}.csv", run));
    for (int k = 0; k < 2000; ++k) {
      const auto [q, v, a] = motion_at(0.01 * k, run);
      columns.evaluate(q, v, a);
      Eigen::Vector3d torque = columns.known();
      torque(1) += 2.0 * std::tanh(v(1) / 0.01);
      for (int j = 0; j < 3; ++j) torque(j) += 0.05 * random.normal();
      const auto [then_q, then_v, then_a] = motion_at(0.01 * k - 0.08, run);
      write_sample(stream, torque, then_q, then_v, then_a);
    }
  }
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  EXPECT_EQ(names_of(*data, diagnosis), "coulomb at shoulder.arm; ");
  ASSERT_EQ(diagnosis.late_channels.size(), 3U);
  for (const LateChannel& late : diagnosis.late_channels) {
    EXPECT_NEAR(late.moved.seconds, -0.08, 0.004) << late.moved.channel;
  }
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained);
}

TEST_F(ForceBalance, RefusesTooFewSamples) {
  record([](double, double) { return 0.0; }, 0.5, 1);
  std::ofstream(folder_ / "run_1.csv") << "force,x,v,a\n1,0,1,0\n2,0.1,1,0\n3,0.2,1,0\n4,0.3,1,0\n";
  EXPECT_THROW((void)problem(), InputError);
}

}  // namespace
}  // namespace graybox
