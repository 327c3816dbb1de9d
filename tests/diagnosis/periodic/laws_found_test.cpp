// Every law of the catalogue, and every kind of place, once from the simulator through `diagnose`
// to the verdict. Drives take all laws but those that only a robot has. What of all this is found
// at which size, the challenge counts (docs/explanation/challenge.md).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "tests/support/recorded_systems.hpp"

namespace graybox {
namespace {

using testing::element;
using testing::HiddenPhysics;
using testing::RecordedRobot;

struct HiddenLaw {
  std::string place;     // as the diagnosis calls it
  std::string location;  // as a model file does
  std::string law;
  std::string parameters;
};

void PrintTo(const HiddenLaw& hidden, std::ostream* stream) {
  *stream << hidden.law << " at " << hidden.place;
}

std::string name_of(const ::testing::TestParamInfo<HiddenLaw>& info) {
  std::string name = info.param.law + "_at_" + info.param.place;
  std::ranges::replace_if(
      name, [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

using Member = std::pair<std::string, std::string>;  // place, law

// All that the answer calls this effect: the law named, those not excluded, and the same at other
// places.
std::set<Member> class_of(const FoundEffect& effect, std::span<const Hypothesis> hypotheses) {
  std::set<Member> members;
  const auto add = [&](const FittedLaw& law) {
    const Hypothesis& hypothesis = hypotheses[law.hypothesis];
    members.emplace(hypothesis.place, hypothesis.law);
  };
  const auto add_all = [&](const FittedLaw& law, const std::vector<FittedLaw>& same_at) {
    add(law);
    for (const FittedLaw& same : same_at) add(same);
  };
  add_all(effect.law, effect.same_at);
  for (const auto* rivals : {&effect.rivals, &effect.generalisations}) {
    for (const Rival& rival : *rivals) add_all(rival.law, rival.same_at);
  }
  return members;
}

std::string failed_tests(const Diagnosis& diagnosis) {
  std::string all;
  for (const VerdictReason& reason : diagnosis.reasons) {
    if (has_failed(reason))
      all += fmt::format("; {}: {:.3g}", reason.test, reason.value.value_or(0.0));
  }
  for (const Implausibility& flaw : diagnosis.implausible) all += "; " + flaw.words;
  return all;
}

void expect_found(const HiddenLaw& hidden, const MismatchProblem& problem) {
  const Diagnosis diagnosis = diagnose(problem);
  EXPECT_TRUE(diagnosis.verdict == Verdict::kExplained || diagnosis.verdict == Verdict::kAmbiguous)
      << to_string(diagnosis.verdict) << failed_tests(diagnosis);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  const auto members = class_of(diagnosis.effects.front(), problem.hypotheses());
  std::string all;
  for (const auto& [place, law] : members) all += fmt::format("{} at {}; ", law, place);
  EXPECT_TRUE(members.contains({hidden.place, hidden.law})) << all;
  // What no periodic recording tells from it.
  if (hidden.law == "coulomb") {
    EXPECT_TRUE(members.contains({hidden.place, "asymmetric_coulomb"})) << all;
  }
  EXPECT_LT(diagnosis.after.estimation.chi_square_per_dof(), 1.15);
  EXPECT_LT(diagnosis.validation_within_errors->chi_square_per_dof(), 1.15);
}

class LawOfADrive : public ::testing::TestWithParam<HiddenLaw> {};

TEST_P(LawOfADrive, IsFound) {
  const HiddenLaw& hidden = GetParam();
  const HiddenPhysics drive(element(hidden.location, hidden.law, hidden.parameters));
  expect_found(hidden, *drive);
}

const std::string kMotor = "{kind: element, mass: motor}", kLoad = "{kind: element, mass: load}",
                  kShaft = "{kind: element, between: [motor, load]}",
                  kActuator = "{kind: actuator, input: torque}",
                  kSensor = "{kind: sensor, output: load_speed}";

const std::vector<HiddenLaw> kLawsOfDrives{
    {"load", kLoad, "stiffness", "stiffness: {value: 1, unit: N m/rad}"},
    {"motor", kMotor, "viscous", "damping: {value: 0.004, unit: N m s/rad}"},
    {"motor", kMotor, "asymmetric_viscous",
     "forward_damping: {value: 0.006, unit: N m s/rad}, backward_damping: {value: 0.002, unit: N m "
     "s/rad}"},
    {"motor", kMotor, "coulomb",
     "level: {value: 0.02, unit: N m}, transition_velocity: {value: 0.3, unit: rad/s}"},
    {"load", kLoad, "stribeck",
     "level: {value: 0.02, unit: N m}, static_level: {value: 0.06, unit: N m}, stribeck_velocity: "
     "{value: 1, unit: rad/s}, transition_velocity: {value: 0.1, unit: rad/s}"},
    {"load", kLoad, "sublinear_friction",
     "level: {value: 0.04, unit: N m}, exponent: {value: 0.5, unit: 1}, reference_velocity: "
     "{value: 1, unit: rad/s}, transition_velocity: {value: 0.1, unit: rad/s}"},
    {"motor", kMotor, "quadratic_drag", "coefficient: {value: 0.002, unit: N m s^2/rad^2}"},
    {"motor", kMotor, "dahl",
     "stiffness: {value: 3, unit: N m/rad}, level: {value: 0.05, unit: N m}"},
    {"load", kLoad, "lugre",
     "stiffness: {value: 5, unit: N m/rad}, bristle_damping: {value: 0.02, unit: N m s/rad}, "
     "damping: {value: 0.01, unit: N m s/rad}, level: {value: 0.03, unit: N m}, static_level: "
     "{value: 0.06, unit: N m}, stribeck_velocity: {value: 0.8, unit: rad/s}"},
    {"motor", kMotor, "ripple",
     "amplitude: {value: 0.03, unit: N m}, period: {value: 0.7, unit: rad}, phase: {value: 0.4, "
     "unit: rad}"},
    {"motor-load", kShaft, "cubic_spring", "stiffness: {value: 20000, unit: N m/rad^3}"},
    {"motor-load", kShaft, "backlash",
     "half_gap: {value: 0.002, unit: rad}, stiffness: {value: 30, unit: N m/rad}"},
    {"motor-load", kShaft, "dead_zone",
     "clearance: {value: 0.012, unit: rad}, stiffness: {value: 30, unit: N m/rad}"},
    {"motor-load", kShaft, "deflection_damping", "coefficient: {value: 1000, unit: N m s/rad^3}"},
    {"motor-load", kShaft, "bouc_wen",
     "stiffness: {value: 10, unit: N m/rad}, yield: {value: 0.006, unit: rad}, exponent: {value: "
     "2, unit: 1}, shape: {value: 0.7, unit: 1}"},
    {"motor-load", kShaft, "play_and_slip",
     "stiffness: {value: 30, unit: N m/rad}, play_stiffness: {value: 2, unit: N m/rad}, half_gap: "
     "{value: 0.003, unit: rad}, level: {value: 0.2, unit: N m}, exponent: {value: 2, unit: 1}"},
    {"load", kLoad, "mode",
     "inertia: {value: 0.0002, unit: kg m^2}, frequency: {value: 25, unit: Hz}, damping_ratio: "
     "{value: 0.03, unit: 1}"},
    {"sensor load_speed", kSensor, "gain", "error: {value: 0.1, unit: 1}"},
    {"sensor load_speed", kSensor, "saturation",
     "limit: {value: 2, unit: rad/s}, corner: {value: 0.2, unit: rad/s}"},
    {"actuator torque", kActuator, "dead_zone", "half_width: {value: 0.03, unit: N m}"},
    {"sensor load_speed", kSensor, "lag", "time_constant: {value: 0.003, unit: s}"},
    {"sensor load_speed", kSensor, "delay", "time: {value: 0.003, unit: s}"},
};

INSTANTIATE_TEST_SUITE_P(Catalogue, LawOfADrive, ::testing::ValuesIn(kLawsOfDrives), name_of);

class LawOfARobot : public ::testing::TestWithParam<HiddenLaw> {};

TEST_P(LawOfARobot, IsFound) {
  const HiddenLaw& hidden = GetParam();
  const std::string element =
      fmt::format("  - {{name: hidden, location: {}, law: {}, parameters: {{{}}}}}\n",
                  hidden.location, hidden.law, hidden.parameters);
  const RecordedRobot robot(element);
  expect_found(hidden, *robot.problem());
}

// Laws that only robots have, and each kind of their places. Gearboxes, constant forces, balancers
// and couplings are those of periodic_mismatch_test.cpp.
const std::vector<HiddenLaw> kLawsOfRobots{
    {"joint_2.bearing_x", "{kind: element, joint: joint_2, axis: bearing_x}", "cubic_spring",
     "stiffness: {value: 5.0e10, unit: N m/rad^3}"},
    {"joint_1.motor", "{kind: element, joint: joint_1, axis: motor}", "viscous",
     "damping: {value: 2.0e-4, unit: N m s/rad}"},
    {"joint_2.arm", "{kind: element, joint: joint_2, axis: arm}", "inertia",
     "inertia: {value: 0.5, unit: kg m^2}"},
    {"flange", "{kind: element, axis: flange}", "payload",
     "mass: {value: 2, unit: kg}, x: {value: 0.05, unit: m}, y: {value: 0, unit: m}, z: {value: "
     "0.1, unit: m}"},
    {"actuator joint_3", "{kind: actuator, joint: joint_3}", "saturation",
     "limit: {value: 0.15, unit: N m}, corner: {value: 0.01, unit: N m}"},
    {"sensor joint_1", "{kind: sensor, joint: joint_1}", "gain", "error: {value: 0.02, unit: 1}"},
};

INSTANTIATE_TEST_SUITE_P(Catalogue, LawOfARobot, ::testing::ValuesIn(kLawsOfRobots), name_of);

// A law that is added to the catalogue is added here.
TEST(Catalogue, EveryLawIsFoundSomewhere) {
  // periodic_mismatch_test.cpp; and the law that is only named, beside Coulomb's.
  std::set<std::string> found{"offset", "balancer", "asymmetric_coulomb"};
  for (const auto* laws : {&kLawsOfDrives, &kLawsOfRobots}) {
    for (const HiddenLaw& each : *laws) found.insert(each.law);
  }
  std::set<std::string> searched;
  const HiddenPhysics drive("");
  const RecordedRobot robot("");
  const auto of_robot = robot.problem();
  for (const Hypothesis& each : drive->hypotheses()) searched.insert(each.law);
  for (const Hypothesis& each : of_robot->hypotheses()) searched.insert(each.law);
  EXPECT_EQ(found, searched);
}

}  // namespace
}  // namespace graybox
