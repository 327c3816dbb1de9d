// The set `any_motion` of the challenge: its integrator, laws, recordings and detectability against
// closed forms, its composition, its files, and what its answers count as.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "bench/any_motion_challenge/any_motion_case.hpp"
#include "bench/any_motion_challenge/any_motion_draw.hpp"
#include "bench/any_motion_challenge/any_motion_laws.hpp"
#include "bench/any_motion_challenge/any_motion_set.hpp"
#include "bench/any_motion_challenge/drive_simulation.hpp"
#include "bench/any_motion_challenge/innovation_detectability.hpp"
#include "bench/any_motion_challenge/stiff_integrator.hpp"
#include "bench/challenge/detectability.hpp"
#include "bench/challenge/same_system.hpp"
#include "bench/challenge/score_challenge.hpp"
#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;
using Eigen::VectorXd;
using graybox::testing::read_text;
using graybox::testing::TemporaryFolder;
using State = StiffIntegrator::State;

const std::vector<Family>& families() { return any_motion_set().families; }

Element element_at(const AnyMotionSystem& system, const std::string& place, const char* law,
                   const std::vector<double>& parameters) {
  const auto found = std::ranges::find_if(
      system.places(), [&](const ChallengePlace& each) { return each.location.name == place; });
  return element_of(*find_any_motion_law(law, place.find(' ') != std::string::npos), *found,
                    parameters);
}

// ---- the integrator -----------------------------------------------------------------------------

TEST(StiffIntegrator, FollowsADampedSwing) {
  const double w = 40.0, d = 0.1;
  StiffIntegrator integrator({1e-9, 1e-11});
  State x(2);
  x << 1.0, 0.0;
  integrator.advance(
      [&](const State& at, State& rate) {
        rate(0) = at(1);
        rate(1) = -w * w * at(0) - 2.0 * d * w * at(1);
      },
      0.7, x);
  const double damped = w * std::sqrt(1.0 - d * d), t = 0.7;
  const double expected =
      std::exp(-d * w * t) * (std::cos(damped * t) + d * w / damped * std::sin(damped * t));
  EXPECT_NEAR(x(0), expected, 1e-7);
}

// A mass that slides to rest under dry friction, its sign rounded over 1e-5 m/s: rate 1e5 1/s.
TEST(StiffIntegrator, TakesStiffFrictionInFewSteps) {
  int calls = 0;
  StiffIntegrator integrator({1e-8, 1e-10});
  State x(2);
  x << 0.0, 1.0;
  const auto rate = [&](const State& at, State& change) {
    ++calls;
    change(0) = at(1);
    change(1) = -std::tanh(at(1) / 1e-5);
  };
  integrator.advance(rate, 5.0, x);
  EXPECT_NEAR(x(0), 0.5, 1e-5);  // v^2 / 2a
  EXPECT_NEAR(x(1), 0.0, 1e-8);
  EXPECT_LT(calls, 20000);
}

TEST(StiffIntegrator, HasTheOrderThatItPromises) {
  // x' = -x^2 has x = 1 / (1 + t); the same tolerance a hundred times smaller costs 100^(1/5).
  std::map<double, int> calls;
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    int count = 0;
    StiffIntegrator integrator({tolerance, 1e-14});
    State x = State::Constant(1, 1.0);
    integrator.advance(
        [&](const State& at, State& rate) {
          ++count;
          rate(0) = -at(0) * at(0);
        },
        10.0, x);
    EXPECT_NEAR(x(0), 1.0 / 11.0, 20.0 * tolerance);
    calls[tolerance] = count;
  }
  EXPECT_LT(calls[1e-10], 3 * calls[1e-8]);  // 2.5, and a little
}

// ---- laws and recordings ------------------------------------------------------------------------

TEST(AnyMotionLaws, AreInTheCatalogueOrNotAsTheySay) {
  std::size_t outside = 0;
  for (const HiddenLaw& law : any_motion_laws()) {
    EXPECT_EQ(law.in_catalogue, find_law(law.name, law.at_signal()) != nullptr) << law.name;
    outside += law.in_catalogue ? 0U : 1U;
    const LawEntry* entry = find_law(law.name, law.at_signal());
    if (entry == nullptr) continue;
    for (const HiddenParameter& parameter : law.parameters) {
      if (!parameter.in_catalogue) continue;
      const auto same = std::ranges::find(entry->parameters, parameter.name, &LawParameter::name);
      ASSERT_NE(same, entry->parameters.end()) << law.name << " " << parameter.name;
      EXPECT_EQ(same->unit, parameter.unit) << law.name << " " << parameter.name;
    }
  }
  EXPECT_GE(outside, 5U);
}

// Without noise the recordings are those of the sampled linear machine: the filter is never wrong.
TEST(DriveSimulation, LinearMachinesAreThoseOfTheMatrixExponential) {
  for (const Family family : families()) {
    const AnyMotionSystem system(family, 4);
    const SampledDrive drive = sampled_drive(system, system.true_values());
    const DriveRecording run = simulate_drive(system, {}, 0, 4, nullptr);
    const StationaryFilter no_filter{
        Eigen::MatrixXd::Zero(drive.transition.rows(), drive.output.rows()),
        Eigen::MatrixXd::Identity(drive.output.rows(), drive.output.rows())};
    EXPECT_LT(innovations(drive, no_filter, run).cwiseAbs().maxCoeff(),
              1e-5 * run.output.cwiseAbs().maxCoeff())
        << to_string(family);
  }
}

TEST(DriveSimulation, LateChannelsAreLate) {
  const AnyMotionSystem system(Family::kAxisEncoder, 4);
  const double late = 0.0053;
  const DriveRecording run =
      simulate_drive(system, {element_at(system, "sensor angle", "delay", {late})}, 1, 4, nullptr);
  // Between samples by the cubic through positions and velocities.
  double worst = 0.0;
  for (Index k = 10; k < run.input.size(); ++k) {
    const Index from = k - 3;  // 0.0053 s = 2.65 samples
    const double s = 0.35, step = kAnyMotionSampleTime;
    const double a = run.position(from, 0), b = run.position(from + 1, 0);
    const double u = run.velocity(from, 0), v = run.velocity(from + 1, 0);
    const double value = (1 + 2 * s) * (1 - s) * (1 - s) * a + s * (1 - s) * (1 - s) * step * u +
                         s * s * (3 - 2 * s) * b - s * s * (1 - s) * step * v;
    worst = std::max(worst, std::abs(value - run.output(k, 0)));
  }
  EXPECT_LT(worst, 1e-7);
  // A late torque: the machine does what it would by the torque of then.
  const DriveRecording moved = simulate_drive(
      system, {element_at(system, "actuator torque", "delay", {2.0 * kAnyMotionSampleTime})}, 1, 4,
      nullptr);
  const SampledDrive drive = sampled_drive(system, system.true_values());
  DriveRecording shifted = moved;
  shifted.input.head(2).setZero();
  shifted.input.tail(moved.input.size() - 2) = moved.input.head(moved.input.size() - 2);
  const StationaryFilter no_filter{Eigen::MatrixXd::Zero(3, 1), Eigen::MatrixXd::Identity(1, 1)};
  EXPECT_LT(innovations(drive, no_filter, shifted).cwiseAbs().maxCoeff(), 1e-5);
}

TEST(DriveSimulation, NoiseIsAsPromised) {
  const AnyMotionSystem system(Family::kAxisEncoder, 8);
  const DriveRecording quiet = simulate_drive(system, {}, 0, 8, nullptr);
  const DriveNoise noise{system.force_noise_share() * root_mean_square(quiet.input), 5};
  const DriveRecording run = simulate_drive(system, {}, 0, 8, &noise);
  const double quantum = system.outputs()[0].quantum;
  for (Index k = 0; k < run.output.rows(); ++k) {
    const double counts = run.output(k, 0) / quantum;
    EXPECT_NEAR(counts, std::round(counts), 1e-6);
    EXPECT_LE(std::abs(run.output(k, 0) - run.position(k, 0)), 0.5001 * quantum);
  }
  const double share = system.force_noise_share();
  EXPECT_GE(share, 0.01);
  EXPECT_LE(share, 0.03);
  const DriveRecording again = simulate_drive(system, {}, 0, 8, &noise);
  EXPECT_EQ(run.output, again.output);
}

// ---- detectability ------------------------------------------------------------------------------

// Noisy innovations of one recording, and their derivatives by the parameters.
struct Innovations {
  VectorXd residual;
  Eigen::MatrixXd jacobian;
};

Innovations noisy_innovations(const AnyMotionSystem& system, const std::vector<Element>& elements,
                              std::size_t index, std::uint64_t seed) {
  constexpr double kStep = 1e-4;
  const VectorXd values = system.true_values();
  const SampledDrive drive = sampled_drive(system, values);
  const DriveRecording quiet = simulate_drive(system, {}, index, seed, nullptr);
  const DriveNoise noise{system.force_noise_share() * root_mean_square(quiet.input), seed + index};
  const DriveRecording run = simulate_drive(system, elements, index, seed, &noise);
  const StationaryFilter filter = filter_for(system, drive, quiet);
  Innovations result{innovations(drive, filter, run), {}};
  result.jacobian.resize(result.residual.size(), values.size());
  for (Index p = 0; p < values.size(); ++p) {
    VectorXd above = values;
    above(p) *= 1.0 + kStep;
    result.jacobian.col(p) =
        (innovations(sampled_drive(system, above), filter, run) - result.residual) / kStep;
  }
  return result;
}

// Over all recordings to fit.
double lack_of_fit(const AnyMotionSystem& system, const std::vector<Element>& elements,
                   std::uint64_t seed) {
  VectorXd residual;
  Eigen::MatrixXd jacobian(0, system.true_values().size());
  for (std::size_t k = 0; k < 3; ++k) {
    const Innovations one = noisy_innovations(system, elements, k, seed);
    const Index before = residual.size(), rows = before + one.residual.size();
    residual.conservativeResize(rows);
    jacobian.conservativeResize(rows, Eigen::NoChange);
    residual.tail(one.residual.size()) = one.residual;
    jacobian.bottomRows(one.residual.size()) = one.jacobian;
  }
  return left_over(residual, jacobian);
}

// With all the noise that a case has, rounding, jitter and force noise with memory, the innovations
// of a machine with nothing missing are as large as they should be; and an effect adds its
// non-centrality, which was computed without noise.
TEST(InnovationDetectability, IsTheLackOfFitThatNoisyRecordingsShow) {
  for (const Family family : families()) {
    const AnyMotionSystem system(family, 12);
    const InnovationDetectability detectability(system, 12);
    const std::string place = system.mass_count() == 1 ? "rotor" : "load";
    const double level = 0.1 * detectability.scale_at(system.places()[0]).force;
    const std::vector<Element> friction{element_at(system, place, "coulomb", {level, 1e-3})};
    const double dof = detectability.degrees_of_freedom();
    const double without = lack_of_fit(system, {}, 12), with = lack_of_fit(system, friction, 12);
    EXPECT_NEAR(without / dof, 1.0, 0.15) << to_string(family);
    const double lambda = detectability.noncentrality(friction);
    EXPECT_NEAR(with - without, lambda, 0.15 * lambda + 3.0 * std::sqrt(2.0 * dof))
        << to_string(family);
    EXPECT_GT(lambda, required_noncentrality(dof)) << to_string(family);
  }
}

// A damping that the model leaves out is linear: with it the innovations are those of a machine
// with other parameters, and grow with the square of its size. What the fit can take up is not
// seen.
TEST(InnovationDetectability, GrowsWithTheSquareOfALinearEffect) {
  const AnyMotionSystem system(Family::kDriveTachometer, 5);
  const InnovationDetectability detectability(system, 5);
  const double bearing = system.true_values()(4);
  const auto lambda = [&](const char* place, double damping) {
    return detectability.noncentrality({element_at(system, place, "viscous", {damping})});
  };
  const double fitted = lambda("load", 0.01 * bearing), seen = lambda("motor", 0.01 * bearing);
  EXPECT_LT(fitted, 0.02 * seen);
  EXPECT_NEAR(lambda("motor", 0.02 * bearing) / seen, 4.0, 0.3);
}

// The non-centrality of one constant force, no parameter refitted against it, in closed form: a
// machine's innovations are linear in the force, so they are the filter's answer to its step.
TEST(InnovationDetectability, IsThatOfTheFiltersAnswerToAConstantForce) {
  const AnyMotionSystem system(Family::kAxisEncoder, 5);
  const InnovationDetectability detectability(system, 5);
  const double force = 1e-3;
  const double lambda =
      detectability.noncentrality({element_at(system, "rotor", "offset", {force})});
  const SampledDrive drive = sampled_drive(system, system.true_values());
  double expected = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const DriveRecording quiet = simulate_drive(system, {}, k, 5, nullptr);
    const StationaryFilter filter = filter_for(system, drive, quiet);
    // e = true - filter, driven by the force and held back by the gain.
    VectorXd error = VectorXd::Zero(3);
    for (Index i = 0; i < quiet.input.size(); ++i) {
      const VectorXd seen = drive.output * error;
      expected += (filter.whitener * seen).squaredNorm();
      error = drive.transition * error - drive.input * force - filter.gain * seen;
    }
  }
  EXPECT_LT(lambda, expected * (1.0 + 1e-3));  // the mass takes up a little
  EXPECT_GT(lambda, 0.5 * expected);
}

// ---- composition, draws, files ------------------------------------------------------------------

TEST(AnyMotionComposition, HasTheSharesPromised) {
  const auto outlines = compose_any_motion(240, 3);
  std::map<CaseKind, int> kinds;
  std::map<Family, int> of_family;
  std::set<std::string> laws;
  for (const CaseOutline& outline : outlines) {
    ++kinds[outline.kind];
    ++of_family[outline.family];
    for (const LawAtPlace& effect : outline.effects) {
      laws.insert(effect.law->name + (effect.law->at_signal() ? " signal" : ""));
    }
    EXPECT_EQ(outline.effects.size(), outline.kind == CaseKind::kNothing      ? 0U
                                      : outline.kind == CaseKind::kTwoEffects ? 2U
                                                                              : 1U);
  }
  EXPECT_EQ(kinds[CaseKind::kNothing], 40);
  EXPECT_EQ(kinds[CaseKind::kOneEffect], 120);
  EXPECT_EQ(kinds[CaseKind::kTwoEffects], 40);
  EXPECT_EQ(kinds[CaseKind::kOutside], 40);
  EXPECT_EQ(of_family[Family::kAxisEncoder], 60);
  EXPECT_EQ(laws.size(), any_motion_laws().size());
}

TEST(AnyMotionDraw, DependsOnTheSeedAloneAndIsDetectable) {
  const AnyMotionSystem system(Family::kAxisTachometer, 6);
  const auto possible = possible_any_motion_effects(system, true);
  const auto friction = std::ranges::find_if(
      possible, [](const LawAtPlace& pair) { return pair.law->name == "coulomb"; });
  ASSERT_NE(friction, possible.end());
  const CaseOutline outline{
      "case_001", Family::kAxisTachometer, CaseKind::kOneEffect, 6, {*friction}};
  const CaseTruth truth = draw_any_motion_case(outline);
  EXPECT_EQ(to_json(truth), to_json(draw_any_motion_case(outline)));
  ASSERT_EQ(truth.effects.size(), 1U);
  EXPECT_TRUE(truth.effects[0].detectable);
  EXPECT_GE(truth.effects[0].relative_size(), 0.999);
  EXPECT_LE(truth.effects[0].relative_size(), 20.0);
  for (const double factor : truth.parameter_factors) EXPECT_NEAR(factor, 1.0, 0.1);
  const CaseTruth read = truth_from_json(to_json(truth), "file");
  EXPECT_EQ(to_json(read), to_json(truth));
  EXPECT_EQ(read.same_places, truth.same_places);
}

CaseTruth truth_of(Family family, std::uint64_t seed, std::vector<HiddenEffect> effects = {}) {
  CaseTruth truth;
  truth.name = "case_001";
  truth.family = family;
  truth.kind = effects.empty()       ? CaseKind::kNothing
               : effects.size() == 1 ? CaseKind::kOneEffect
                                     : CaseKind::kTwoEffects;
  truth.seed = seed;
  truth.effects = std::move(effects);
  truth.same_places = AnyMotionSystem(family, seed).same_places();
  return truth;
}

HiddenEffect effect_of(const std::string& place, const std::string& law,
                       const std::vector<double>& values) {
  HiddenEffect effect{place, law};
  effect.at_signal = place.find(' ') != std::string::npos;
  const HiddenLaw* hidden = find_any_motion_law(law, effect.at_signal);
  for (std::size_t k = 0; k < values.size(); ++k) {
    effect.parameters.push_back(
        {hidden->parameters[k].name, "N m", values[k], hidden->parameters[k].in_catalogue});
  }
  effect.size = effect.smallest_size = 1.0;
  effect.detectable = true;
  return effect;
}

TEST(AnyMotionCase, FilesTellNothingOfTheContentAndCanBeRead) {
  const TemporaryFolder folder;
  for (const Family family : families()) {
    const std::string name(to_string(family));
    const std::string mass = name.starts_with("axis") ? "rotor" : "load";
    const HiddenEffect friction = effect_of(mass, "coulomb", {0.01, 1e-3});
    ASSERT_TRUE(write_any_motion_case(truth_of(family, 9), folder.file(name + "a")));
    ASSERT_TRUE(write_any_motion_case(truth_of(family, 9, {friction}), folder.file(name + "b")));
    ASSERT_TRUE(write_any_motion_case(truth_of(family, 10), folder.file(name + "c")));
    std::size_t files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder.file(name + "a"))) {
      if (!entry.is_regular_file()) continue;
      ++files;
      const fs::path relative = fs::relative(entry.path(), folder.file(name + "a"));
      for (const char* twin : {"b", "c"}) {
        EXPECT_EQ(fs::file_size(folder.file(name + twin) / relative), entry.file_size())
            << name << relative;
      }
      EXPECT_EQ(read_text(entry.path()).find("seed"), std::string::npos);
    }
    EXPECT_EQ(files, 7U);  // model, campaign, five recordings
    EXPECT_NE(read_text(folder.file(name + "a/campaign/run_1.csv")),
              read_text(folder.file(name + "b/campaign/run_1.csv")));
    const LumpedModel model = load_lumped_model(folder.file(name + "a/model.yaml"));
    EXPECT_EQ(model.mass.rows(), name.starts_with("axis") ? 1 : 2);
    const Campaign campaign = read_campaign(folder.file(name + "a/campaign"));
    EXPECT_NO_THROW((void)load_experiment(campaign, 0));
  }
}

// ---- what diagnoses say of such cases ---------------------------------------------------------

PredictionDiagnosis diagnosis_of(const CaseTruth& truth) {
  const TemporaryFolder folder;
  EXPECT_TRUE(write_any_motion_case(truth, folder.file("case")));
  return diagnose_by_prediction(folder.file("case/model.yaml"),
                                read_campaign(folder.file("case/campaign")), {}, 2);
}

// A tachometer that lags by half a sample, beside a disturbance: 1.2 times what is detectable.
// Where errors add up, over ten samples and more, the disturbance hides it.
TEST(AnyMotionDiagnosis, FindsALagThatADisturbanceHidesOverLongerWindows) {
  constexpr std::uint64_t kSeed = 9017832381802315296ULL;
  const HiddenEffect lag = effect_of("sensor speed", "lag", {0.00119249});
  const PredictionDiagnosis found = diagnosis_of(truth_of(Family::kAxisTachometer, kSeed, {lag}));
  ASSERT_EQ(found.diagnosis.effects.size(), 1U);
  const FittedLaw& law = found.diagnosis.effects[0].law;
  const std::string& name = found.hypotheses[law.hypothesis].law;
  EXPECT_TRUE(name == "lag" || name == "delay") << name;
  EXPECT_NEAR(law.parameters[0].value, 0.00119249, 3.0 * law.parameters[0].standard_error);
  const PredictionDiagnosis nothing = diagnosis_of(truth_of(Family::kAxisTachometer, kSeed));
  EXPECT_EQ(nothing.diagnosis.verdict, Verdict::kNone);
  EXPECT_TRUE(nothing.diagnosis.effects.empty());
}

// Friction that fades is no friction of one level.
TEST(AnyMotionDiagnosis, DoesNotExplainFrictionThatFades) {
  constexpr std::uint64_t kSeed = 968126486364453142ULL;
  const HiddenEffect fading =
      effect_of("rotor", "fading_friction", {0.0296743, 3.81176, 0.00194429});
  const PredictionDiagnosis result =
      diagnosis_of(truth_of(Family::kAxisTachometer, kSeed, {fading}));
  EXPECT_EQ(result.diagnosis.verdict, Verdict::kUnknown);
  const auto reason = std::ranges::find_if(result.diagnosis.reasons, [](const VerdictReason& each) {
    return each.test.starts_with("what was found changes");
  });
  ASSERT_NE(reason, result.diagnosis.reasons.end());
  EXPECT_FALSE(reason->passed);
  EXPECT_NE(reason->test.find("where recordings begin"), std::string::npos) << reason->test;
}

// ---- what answers count as ----------------------------------------------------------------------

AnsweredLaw named(const std::string& place, const std::string& law, double value = 0.0) {
  return {place, law, {{"level", {value, 0.1}}}};
}

Answer answer_of(const std::string& verdict, std::vector<std::vector<AnsweredLaw>> effects) {
  return {.given = true, .verdict = verdict, .effects = std::move(effects), .seconds = 1.0};
}

TEST(AnyMotionScore, NamesCountAsSystems) {
  CaseTruth truth = truth_of(Family::kDriveMotorEncoder, 3, {effect_of("load", "coulomb", {0.5})});
  const auto outcome = [&](std::vector<std::vector<AnsweredLaw>> effects) {
    return score_case(truth, answer_of("explained", std::move(effects))).outcome;
  };
  truth.same_places = {{"force", {"motor", "load"}}, {"offset", {"actuator torque", "motor"}}};
  EXPECT_EQ(outcome({{named("load", "coulomb", 0.5)}}), "right");
  EXPECT_EQ(outcome({{named("motor", "coulomb", 0.5)}}), "right");
  EXPECT_EQ(outcome({{named("motor", "viscous")}}), "wrong_confident");
  truth.same_places.erase("force");  // a soft shaft
  EXPECT_EQ(outcome({{named("motor", "coulomb", 0.5)}}), "wrong_confident");

  truth.effects = {effect_of("motor", "offset", {0.1})};
  EXPECT_EQ(outcome({{named("actuator torque", "offset")}}), "right");
  truth.effects = {effect_of("motor-load", "backlash", {0.1, 1.0, 0.01})};
  EXPECT_EQ(outcome({{named("motor-load", "dead_zone")}}), "right");
  EXPECT_EQ(outcome({{named("motor-load", "cubic_spring")}}), "wrong_confident");
  truth.effects = {effect_of("sensor motor_angle", "delay", {1e-3})};
  EXPECT_EQ(outcome({{named("sensor motor_angle", "lag")}}), "right");
  EXPECT_EQ(outcome({{named("actuator torque", "lag")}}), "wrong_confident");
  truth.same_places["late"] = {"actuator torque", "sensor motor_angle"};
  EXPECT_EQ(outcome({{named("actuator torque", "lag")}}), "right");
  EXPECT_EQ(outcome({{named("actuator torque", "saturation")}}), "wrong_confident");
}

TEST(AnyMotionScore, WhatGoesTogetherFollowsFromWhatIsMeasured) {
  for (const Family family : families()) {
    const auto groups = AnyMotionSystem(family, 3).same_places();
    const bool is_alone = family != Family::kDriveEncoders;
    EXPECT_EQ(groups.contains("late"), is_alone) << to_string(family);
    const bool has_tachometer =
        family == Family::kAxisTachometer || family == Family::kDriveTachometer;
    const bool is_drive = family != Family::kAxisEncoder && family != Family::kAxisTachometer;
    EXPECT_EQ(groups.at("offset").size(),
              2U + (has_tachometer ? 1U : 0U) + (is_drive && is_alone ? 1U : 0U));
    EXPECT_FALSE((!is_drive || !is_alone) && groups.contains("force"));
  }
}

TEST(AnyMotionScore, ClassesAreAsLargeAsTheyHaveSystems) {
  const CaseTruth truth =
      truth_of(Family::kAxisEncoder, 3, {effect_of("sensor angle", "delay", {1e-3})});
  const ScoredCase scored = score_case(
      truth,
      answer_of("ambiguous", {{named("actuator torque", "delay"), named("sensor angle", "delay"),
                               named("sensor angle", "lag"), named("actuator torque", "lag")}}));
  EXPECT_EQ(scored.class_size, 4U);
  EXPECT_EQ(scored.systems, 1U);
  EXPECT_EQ(scored.outcome, "in_class");
}

TEST(AnyMotionScore, AsymmetricFrictionIsFrictionAndAnOffset) {
  const CaseTruth truth =
      truth_of(Family::kAxisEncoder, 3, {effect_of("rotor", "asymmetric_coulomb", {0.3, 0.1})});
  const ScoredCase scored = score_case(
      truth,
      answer_of("explained", {{named("rotor", "coulomb")}, {named("actuator torque", "offset")}}));
  EXPECT_EQ(scored.outcome, "right");
  EXPECT_FALSE(scored.extra);
  EXPECT_EQ(score_case(truth, answer_of("explained", {{named("rotor", "coulomb")}})).outcome,
            "wrong_confident");
}

TEST(AnyMotionScore, PairsAndRatesCountWhatTheyName) {
  const CaseTruth two = truth_of(
      Family::kDriveEncoders, 3,
      {effect_of("motor", "coulomb", {0.5}), effect_of("sensor load_angle", "delay", {1e-3})});
  EXPECT_EQ(score_case(two, answer_of("explained", {{named("sensor load_angle", "lag")},
                                                    {named("motor", "coulomb")}}))
                .outcome,
            "both");
  EXPECT_EQ(score_case(two, answer_of("explained", {{named("motor", "coulomb")}})).outcome, "one");
  Score score;
  score.origin.set = kAnyMotionSet;
  CaseTruth outside =
      truth_of(Family::kAxisEncoder, 3, {effect_of("rotor", "fading_friction", {0.5, 2.0, 1e-3})});
  outside.kind = CaseKind::kOutside;
  Answer predicts = answer_of("explained", {{named("rotor", "coulomb")}});
  predicts.error_kept_out = 0.03;
  predicts.validation = 40.0;
  score.cases = {score_case(two, answer_of("none", {})),
                 score_case(outside, answer_of("unknown", {})), score_case(outside, predicts),
                 score_case(truth_of(Family::kAxisEncoder, 3), answer_of("unknown", {}))};
  std::map<std::string, Rate> rates;
  for (const NamedRate& each : rates_of(score)) rates[each.name] = each.rate;
  EXPECT_EQ(rates["outside_unknown"].hits, 1U);
  EXPECT_EQ(rates["outside_unknown"].of, 2U);
  EXPECT_EQ(rates["false_alarms"].hits, 1U);
  EXPECT_EQ(rates["two_effects_both"].of, 1U);
  EXPECT_EQ(rates["explained_at_noise_floor"].hits, 1U);

  // Rates of another set stay in the common table.
  const TemporaryFolder folder;
  Score periodic;
  write_score_tables(periodic, folder.file("tables"));
  write_score_tables(score, folder.file("tables"));
  write_score_tables(score, folder.file("tables"));
  const std::string table = read_text(folder.file("tables/challenge_rates.csv"));
  const auto count = [&](const std::string& word) {
    std::size_t found = 0;
    for (auto at = table.find(word); at != std::string::npos; at = table.find(word, at + 1)) {
      ++found;
    }
    return found;
  };
  EXPECT_EQ(count("\nperiodic,answered"), 1U);
  EXPECT_EQ(count("\nany_motion,answered"), 1U);
  EXPECT_EQ(
      read_text(folder.file("tables/challenge_any_motion_refusal.csv")).find("0.01,2,2,0,0\n") !=
          std::string::npos,
      true);
}

}  // namespace
}  // namespace graybox::bench
