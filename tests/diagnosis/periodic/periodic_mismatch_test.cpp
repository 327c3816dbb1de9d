// The diagnosis of periodic recordings on simulated drives whose missing physics is known.
#include "diagnosis/periodic/periodic_mismatch.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <filesystem>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/harmonic_balance/period_transform.hpp"
#include "diagnosis/harmonic_balance/periodic_law.hpp"
#include "diagnosis/harmonic_balance/sampled_response.hpp"
#include "diagnosis/hypotheses/law_shapes.hpp"
#include "diagnosis/periodic/periodic_shapes.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/simulation/exact_plant.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "diagnosis/verdict/verdict_file.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"
#include "tests/support/recorded_systems.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using testing::drive;
using testing::element;
using testing::HiddenPhysics;
using testing::kDrive;
using testing::RecordedRobot;

const HypothesisScore& best_of(const ScoreTable& table) {
  return *std::ranges::max_element(table.scores, {}, [](const HypothesisScore& score) {
    return score.score.statistic - 8.0 * score.score.degrees_of_freedom;
  });
}

// The place is ranked first, with this law close to the best there (laws that bend alike are told
// apart by refits); the refit finds the hidden parameters, and what is left is noise, also on the
// recordings that were kept out.
void expect_found(const HiddenPhysics& hidden, const std::string& place, const std::string& law,
                  const std::vector<double>& truth, std::size_t checked) {
  const ExtendedFit before = hidden->fit({}, nullptr);
  ASSERT_TRUE(before.usable) << before.trouble;
  EXPECT_GT(before.estimation.chi_square_per_dof(), 1.5);
  const ScoreTable table = hidden->scores(before, hidden.all(), 0, 1);
  const HypothesisScore& best = best_of(table);
  const Hypothesis& named = hidden->hypotheses()[best.start.hypothesis];
  EXPECT_EQ(named.place, place);
  const std::size_t index = hidden.index_of(place, law);
  const auto found = std::ranges::find_if(
      table.scores, [&](const HypothesisScore& score) { return score.start.hypothesis == index; });
  ASSERT_NE(found, table.scores.end());
  EXPECT_GT(found->score.statistic, 0.6 * best.score.statistic);
  const ExtendedFit after = hidden->fit(std::vector<LawStart>{found->start}, &before);
  ASSERT_TRUE(after.usable) << after.trouble;
  EXPECT_LT(after.estimation.chi_square_per_dof(), 1.15);
  for (std::size_t p = 0; p < checked; ++p) {
    const LawParameterEstimate& estimate = after.laws[0].parameters[p];
    EXPECT_NEAR(estimate.value, truth[p], 4.0 * estimate.standard_error) << estimate.name;
    EXPECT_LT(estimate.standard_error, 0.1 * std::abs(truth[p])) << estimate.name;
  }
  const std::optional<Assessment> held_out = hidden->validate(after);
  ASSERT_TRUE(held_out.has_value());
  EXPECT_LT(held_out->chi_square_per_dof(), 1.2);
  EXPECT_GT(hidden->validate(before)->chi_square_per_dof(), held_out->chi_square_per_dof());
}

TEST(PeriodTransform, GoesThereAndBack) {
  constexpr Index lines = 7;
  PeriodTransform transform(50, lines, fast_grid(17));
  Eigen::VectorXcd spectrum(lines + 1);
  for (Index k = 0; k <= lines; ++k) {
    spectrum(k) = {1.0 / (1.0 + static_cast<double>(k)), k == 0 ? 0.0 : 0.3};
  }
  Eigen::VectorXd times(transform.grid());
  transform.to_times(spectrum, times);
  double direct = spectrum(0).real();
  const double t = 3.0 / static_cast<double>(transform.grid());
  for (Index k = 1; k <= lines; ++k) {
    direct +=
        2.0 *
        (spectrum(k) * std::polar(1.0, 2.0 * std::numbers::pi * static_cast<double>(k) * t)).real();
  }
  EXPECT_NEAR(times(3), direct / std::sqrt(50.0), 1e-14);
  Eigen::VectorXcd back(lines + 1);
  transform.to_lines(times, back);
  EXPECT_LT((back - spectrum).norm(), 1e-13);
  EXPECT_THROW(PeriodTransform(50, 7, 14), InputError);
}

// y of the plant that is solved exactly from sample to sample, in its steady state.
TEST(SampledResponse, IsThatOfThePlantBehindItsHold) {
  LinearMotion motion;
  motion.mass = Eigen::Vector2d(0.002, 0.01).asDiagonal();
  motion.stiffness.resize(2, 2);
  motion.stiffness << 31.0, -30.0, -30.0, 33.0;
  motion.damping = 2e-2 * motion.stiffness;
  motion.input = Eigen::MatrixXd::Identity(2, 1);
  motion.position_output = Eigen::Matrix2d::Zero();
  motion.position_output(1, 1) = 1.0;
  motion.velocity_output = Eigen::Matrix2d::Zero();
  motion.velocity_output(0, 0) = 1.0;
  motion.rest = Eigen::Vector2d::Zero();
  motion.rest_input = Eigen::VectorXd::Zero(1);
  motion.rest_force = Eigen::Vector2d::Zero();
  LinearPlant plant;
  plant.mass = motion.mass;
  plant.damping = motion.damping;
  plant.stiffness = motion.stiffness;
  plant.input = motion.input;
  plant.position_output = motion.position_output;
  plant.velocity_output = motion.velocity_output;
  constexpr double sample_time = 0.001;
  constexpr Index period = 200;
  const auto sampled = exact_plant(motion, sample_time);
  for (const Index line : {1, 7, 20, 50}) {
    const double w = 2.0 * std::numbers::pi * static_cast<double>(line) /
                     (static_cast<double>(period) * sample_time);
    sampled->restart();
    Eigen::Vector2cd sum = Eigen::Vector2cd::Zero();
    for (Index t = 0; t < 41 * period; ++t) {
      const Complex turn = std::polar(1.0, w * sample_time * static_cast<double>(t));
      if (t >= 40 * period) sum += sampled->output() * std::conj(turn) * 2.0 / period;
      sampled->advance(Eigen::VectorXd::Constant(1, turn.real()));
    }
    const Eigen::MatrixXcd response = sampled_response(plant, w, sample_time);
    EXPECT_LT((response.col(0) - sum).norm(), 2e-6 * sum.norm()) << line;
  }
}

TEST(SampledResponse, DerivativesOfImagesAreThoseOfDifferences) {
  LinearPlant plant;
  plant.mass = Eigen::Vector2d(0.002, 0.01).asDiagonal();
  plant.stiffness.resize(2, 2);
  plant.stiffness << 31.0, -30.0, -30.0, 33.0;
  plant.damping = 2e-2 * plant.stiffness;
  plant.input = Eigen::MatrixXd::Identity(2, 1);
  plant.position_output = plant.velocity_output = Eigen::Matrix2d::Identity();
  plant.derivatives.push_back({Eigen::Vector2d(1.0, 0.0).asDiagonal(), {}, {}});
  plant.derivatives.push_back({{}, {}, Eigen::Matrix2d{{1.0, -1.0}, {-1.0, 1.0}}});
  for (const double sample_time : {0.001, 0.01}) {  // the second with images among the poles
    const double w = 0.6 / sample_time;
    std::vector<Eigen::MatrixXcd> derivatives;
    (void)HeldImages(plant, sample_time).response(w, &derivatives);
    ASSERT_EQ(derivatives.size(), 2U);
    for (const int p : {0, 1}) {
      const double step = p == 0 ? 1e-7 : 1e-3;
      LinearPlant above = plant, below = plant;
      if (p == 0) {
        above.mass(0, 0) += step;
        below.mass(0, 0) -= step;
      } else {
        above.stiffness += step * plant.derivatives[1].stiffness;
        below.stiffness -= step * plant.derivatives[1].stiffness;
      }
      const Eigen::MatrixXcd difference = (HeldImages(above, sample_time).response(w) -
                                           HeldImages(below, sample_time).response(w)) /
                                          (2.0 * step);
      const Eigen::MatrixXcd& derivative = derivatives[static_cast<std::size_t>(p)];
      EXPECT_LT((derivative - difference).norm(), 1e-4 * difference.norm()) << p;
    }
  }
}

TEST(PeriodicLaw, LinearLawsAreThoseOfTheCatalogue) {
  const double w = 17.0;
  const LawEntry& mode = *find_law("mode", false);
  const std::vector<double> parameters{0.3, 2.0, 0.1};
  const PeriodicLaw law(mode, parameters);
  // The state equation of the law itself, solved at one frequency.
  const auto reference = mode.make(parameters);
  const std::vector<double> zero{0.0, 0.0};
  const double spring = reference->force(1.0, 0.0, zero), damper = reference->force(0.0, 1.0, zero);
  const Complex kappa(spring, w * damper);
  EXPECT_LT(std::abs(*law.response(w) + w * w * 0.3 * kappa / (kappa - w * w * 0.3)), 1e-9);
}

TEST(PeriodicLaw, BristlesFollowTheirEquation) {
  // Dahl's law under a slow sine: within the reach a spring, beyond it the level.
  const PeriodicLaw law(*find_law("dahl", false), std::vector<double>{100.0, 1.0});
  PeriodicMotion motion;
  constexpr Index grid = 4000;
  motion.deflection.resize(grid);
  motion.rate.resize(grid);
  motion.step = 1.0 / grid;
  for (Index t = 0; t < grid; ++t) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(t) / grid;
    motion.deflection(t) = std::sin(angle);
    motion.rate(t) = 2.0 * std::numbers::pi * std::cos(angle);
  }
  Eigen::VectorXd force;
  law.force(motion, force);
  EXPECT_NEAR(force(grid / 8), 1.0, 1e-3);
  EXPECT_NEAR(force(3 * grid / 8), -1.0, 1e-3);
  // After the turn at z = 1: f = 2 exp(-s (1 - z) / F_c) - 1.
  const Index after = grid / 4 + 60;
  EXPECT_NEAR(force(after), 2.0 * std::exp(-100.0 * (1.0 - motion.deflection(after))) - 1.0, 1e-2);
}

PeriodicMotion motion_of_three_tones(double size) {
  constexpr Index grid = 3000;
  PeriodicMotion motion;
  motion.deflection.resize(grid);
  motion.rate.resize(grid);
  motion.step = 1.0 / grid;
  for (Index t = 0; t < grid; ++t) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(t) / grid;
    motion.deflection(t) =
        size * (std::sin(angle) + 0.4 * std::cos(3.0 * angle) + 0.2 * std::sin(7.0 * angle));
    motion.rate(t) = size * 2.0 * std::numbers::pi *
                     (std::cos(angle) - 1.2 * std::sin(3.0 * angle) + 1.4 * std::cos(7.0 * angle));
  }
  return motion;
}

// The tangents are compared with the force of a motion that is a little larger and later, also
// where the force remembers.
TEST(PeriodicLaw, TangentsAreThoseOfDifferences) {
  struct Example {
    const char* law;
    std::vector<double> parameters;
  };
  for (const Example& example : {Example{"cubic_spring", {3.0}}, Example{"coulomb", {1.0, 2.0}},
                                 Example{"quadratic_drag", {0.3}}, Example{"dahl", {30.0, 1.0}},
                                 Example{"bouc_wen", {20.0, 0.1, 2.0, 0.6}},
                                 Example{"lugre", {30.0, 0.1, 0.05, 1.0, 1.5, 2.0}}}) {
    const PeriodicLaw law(*find_law(example.law, false), example.parameters);
    const PeriodicMotion motion = motion_of_three_tones(0.5);
    PeriodicMotion change = motion;
    const Index grid = motion.deflection.size();
    for (Index t = 0; t < grid; ++t) {
      const double angle =
          2.0 * std::numbers::pi * static_cast<double>(t) / static_cast<double>(grid);
      change.deflection(t) = std::sin(2.0 * angle) + 0.3 * std::cos(5.0 * angle);
      change.rate(t) =
          2.0 * std::numbers::pi * (2.0 * std::cos(2.0 * angle) - 1.5 * std::sin(5.0 * angle));
    }
    LawTangent tangent;
    law.linearise(motion, tangent);
    Eigen::VectorXd predicted, above, below;
    tangent.apply(change, predicted);
    constexpr double step = 1e-5;
    const auto moved = [&](double share) {
      PeriodicMotion result = motion;
      result.deflection += share * change.deflection;
      result.rate += share * change.rate;
      return result;
    };
    law.force(moved(step), above);
    law.force(moved(-step), below);
    const Eigen::VectorXd difference = (above - below) / (2.0 * step);
    EXPECT_LT((predicted - difference).norm(), 0.02 * difference.norm()) << example.law;
  }
}

TEST(PeriodicMismatch, FitsATrueModelDownToTheNoise) {
  const HiddenPhysics nothing("");
  const ExtendedFit fit = nothing->fit({}, nullptr);
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.15);
  const std::vector<double> truth{0.0021, 0.01, 30.0, 0.03, 0.05};
  ASSERT_EQ(fit.model_parameters.size(), truth.size());
  for (std::size_t p = 0; p < truth.size(); ++p) {
    const LawParameterEstimate& estimate = fit.model_parameters[p];
    EXPECT_NEAR(estimate.value, truth[p], 4.0 * estimate.standard_error) << estimate.name;
  }
  EXPECT_NEAR(nothing->validate(fit)->chi_square_per_dof(), 1.0, 0.2);
  double cells = 0.0;
  for (const MismatchCell& cell : nothing->mismatch(fit)) cells += cell.statistic;
  EXPECT_NEAR(cells, fit.deviance, 1e-3 * fit.deviance);
}

TEST(PeriodicMismatch, NamesDryFrictionOfTheMotor) {
  expect_found(HiddenPhysics(element("{kind: element, mass: motor}", "coulomb",
                                     "level: {value: 0.02, unit: N m}, transition_velocity: "
                                     "{value: 0.3, unit: rad/s}")),
               "motor", "coulomb", {0.02, 0.3}, 2);
}

TEST(PeriodicMismatch, NamesAHardeningShaft) {
  expect_found(HiddenPhysics(element("{kind: element, between: [motor, load]}", "cubic_spring",
                                     "stiffness: {value: 20000, unit: N m/rad^3}")),
               "motor-load", "cubic_spring", {20000.0}, 1);
}

// From recordings to the verdict.
void expect_explained(const HiddenPhysics& hidden, const std::string& place, const std::string& law,
                      const std::vector<double>& truth) {
  SearchOptions options;
  options.shortlist = 2;
  options.null_draws = 79;
  const Diagnosis diagnosis = diagnose(*hidden, options);
  EXPECT_TRUE(diagnosis.detection.detected);
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  const FittedLaw& found = diagnosis.effects.front().law;
  EXPECT_EQ(found.hypothesis, hidden.index_of(place, law));
  for (std::size_t p = 0; p < truth.size(); ++p) {
    EXPECT_NEAR(found.parameters[p].value, truth[p], 4.0 * found.parameters[p].standard_error)
        << found.parameters[p].name;
  }
}

// What has been cut off is not in the recordings any more: most of the signal looks like a gain
// error.
TEST(PeriodicMismatch, RanksASaturationBeforeTheGainErrorThatItLooksLike) {
  const HiddenPhysics hidden(
      element("{kind: sensor, output: speed}", "saturation",
              "limit: {value: 1.0, unit: rad/s}, corner: {value: 0.2, unit: rad/s}"));
  const ExtendedFit before = hidden->fit({}, nullptr);
  ASSERT_TRUE(before.usable) << before.trouble;
  const std::vector<std::size_t> laws{hidden.index_of("sensor speed", "saturation"),
                                      hidden.index_of("sensor speed", "gain")};
  const ScoreTable table = hidden->scores(before, laws, 0, 1);
  EXPECT_GT(table.scores[0].score.statistic, 1.1 * table.scores[1].score.statistic);
  EXPECT_NEAR(table.scores[0].start.parameters[0], 1.0, 0.3);
}

TEST(PeriodicMismatch, ExplainsAnExtraMode) {
  expect_explained(HiddenPhysics(element("{kind: element, mass: load}", "mode",
                                         "inertia: {value: 0.0002, unit: kg m^2}, frequency: "
                                         "{value: 25, unit: Hz}, damping_ratio: {value: 0.03, "
                                         "unit: 1}")),
                   "load", "mode", {0.0002, 25.0, 0.03});
}

// Sliding friction whose bristles bend: the steady state is found with what the force remembers.
TEST(PeriodicMismatch, FitsBristlesDownToTheNoise) {
  const HiddenPhysics hidden(element("{kind: element, mass: motor}", "dahl",
                                     "stiffness: {value: 3, unit: N m/rad}, level: "
                                     "{value: 0.05, unit: N m}"));
  const ExtendedFit before = hidden->fit({}, nullptr);
  ASSERT_TRUE(before.usable) << before.trouble;
  EXPECT_GT(before.estimation.chi_square_per_dof(), 3.0);
  const std::size_t dahl = hidden.index_of("motor", "dahl");
  const ScoreTable table = hidden->scores(before, std::vector<std::size_t>{dahl}, 0, 1);
  const ExtendedFit after = hidden->fit(std::vector<LawStart>{table.scores.front().start}, &before);
  ASSERT_TRUE(after.usable) << after.trouble;
  EXPECT_NEAR(after.estimation.chi_square_per_dof(), 1.0, 0.15);
  // Solved anew from the recordings, the fitted model is as good as the fit says.
  const double numbers = hidden->sample_count() - static_cast<double>(after.parameter_count);
  EXPECT_NEAR(after.estimation.chi_square_per_dof(), after.deviance / numbers, 0.01);
  const std::vector<double> truth{3.0, 0.05};
  for (std::size_t p = 0; p < truth.size(); ++p) {
    const LawParameterEstimate& estimate = after.laws.front().parameters[p];
    EXPECT_NEAR(estimate.value, truth[p], 4.0 * estimate.standard_error) << estimate.name;
  }
}

std::string one_sensor_drive() {
  std::string text = kDrive;
  text.erase(text.find("  - {name: load_speed"),
             text.find("noise:") - text.find("  - {name: load_speed"));
  text.replace(text.find(", load_speed: 0.005"), 19, "");
  return text;
}

// Beside a law that is not linear, too: a delay passes through whatever does not change with time.
TEST(PeriodicMismatch, ADelayBesideDragIsOneSystemAtTwoPlaces) {
  std::string physics = element("{kind: element, mass: motor}", "quadratic_drag",
                                "coefficient: {value: 0.002, unit: N m s^2/rad^2}");
  physics +=
      "  - {name: late, location: {kind: sensor, output: speed}, law: delay, parameters: "
      "{time: {value: 0.0015, unit: s}}}\n";
  const HiddenPhysics hidden(physics, one_sensor_drive());
  const ExtendedFit before = hidden->fit({}, nullptr);
  const LawStart drag{hidden.index_of("motor", "quadratic_drag"), {0.002}};
  std::vector<ExtendedFit> fits;
  for (const char* place : {"actuator torque", "sensor speed"}) {
    const LawStart late{hidden.index_of(place, "delay"), {0.0015}};
    fits.push_back(hidden->fit(std::vector<LawStart>{drag, late}, &before));
    ASSERT_TRUE(fits.back().usable) << fits.back().trouble;
    EXPECT_LT(fits.back().estimation.chi_square_per_dof(), 1.15) << place;
  }
  EXPECT_NEAR(fits[0].deviance, fits[1].deviance, 1.0);
  const auto experiments = hidden->experiments_between(fits[0], fits[1]);
  ASSERT_TRUE(experiments.has_value());
  EXPECT_LT(experiments->distance_at_best, 0.02);
}

// With one input and one output it can't be told which of them is late; and that something is,
// which leaves the recordings far from the model, must not make a gain error look like it.
TEST(PeriodicMismatch, ADelayOfTheOnlyChannelsIsOneSystemAtTwoPlaces) {
  const HiddenPhysics hidden(
      element("{kind: actuator, input: torque}", "delay", "time: {value: 0.0015, unit: s}"),
      one_sensor_drive());
  const ExtendedFit before = hidden->fit({}, nullptr);
  EXPECT_GT(before.estimation.chi_square_per_dof(), 3.0);
  for (const char* place : {"actuator torque", "sensor speed"}) {
    const std::size_t gain = hidden.index_of(place, "gain");
    const ScoreTable table = hidden->scores(before, std::vector<std::size_t>{gain}, 0, 1);
    EXPECT_EQ(table.scores.front().score.degrees_of_freedom, 0.0) << place;
  }
  SearchOptions options;
  options.null_draws = 79;
  const Diagnosis diagnosis = diagnose(*hidden, options);
  EXPECT_EQ(diagnosis.verdict, Verdict::kAmbiguous);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  const FoundEffect& effect = diagnosis.effects.front();
  EXPECT_EQ(hidden->hypotheses()[effect.law.hypothesis].law, "delay");
  ASSERT_EQ(effect.same_at.size(), 1U);
  const Hypothesis& other = hidden->hypotheses()[effect.same_at.front().hypothesis];
  EXPECT_EQ(other.law, "delay");
  EXPECT_NE(other.place, hidden->hypotheses()[effect.law.hypothesis].place);
  for (const FittedLaw& law : {effect.law, effect.same_at.front()}) {
    EXPECT_NEAR(law.parameters[0].value, 0.0015, 4.0 * law.parameters[0].standard_error);
  }
}

// Torque in other units scales all masses, springs and dampers: no data of this drive tell.
TEST(PeriodicMismatch, SaysThatTheGainOfTheActuatorCannotBeSeen) {
  const HiddenPhysics hidden(
      element("{kind: actuator, input: torque}", "gain", "error: {value: 0.05, unit: 1}"));
  const ExtendedFit fit = hidden->fit({}, nullptr);
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.15);
  const std::size_t gain = hidden.index_of("actuator torque", "gain");
  const ScoreTable table = hidden->scores(fit, std::vector<std::size_t>{gain}, 0, 1);
  EXPECT_EQ(table.scores.front().score.degrees_of_freedom, 0.0);
  const ExtendedFit with = hidden->fit(std::vector<LawStart>{{gain, {0.01}, {}}}, &fit);
  EXPECT_TRUE(std::isnan(with.laws.front().parameters.front().standard_error));
}

// At 5 % more than 2 of 6 are seen once in 450 times.
TEST(PeriodicMismatch, RaisesFewFalseAlarms) {
  int alarms = 0;
  for (std::uint64_t seed = 11; seed < 17; ++seed) {
    const HiddenPhysics nothing("", seed);
    const ExtendedFit fit = nothing->fit({}, nullptr);
    ASSERT_TRUE(fit.usable) << fit.trouble;
    const ScoreTable table = nothing->scores(fit, nothing.all(), 79, 1);
    double least = 1.0;
    for (const HypothesisScore& score : table.scores) least = std::min(least, score.score.p_value);
    const double lack =
        chi_square_tail(fit.estimation.chi_square, fit.estimation.degrees_of_freedom);
    if (lack < 0.025 || least < family_threshold(table.null_minima, 0.025)) ++alarms;
  }
  EXPECT_LE(alarms, 2);
}

TEST(PeriodicMismatch, FindsNothingMissingInARobotWithItsOwnNonLinearities) {
  const RecordedRobot robot("");
  const auto problem = robot.problem();
  const ExtendedFit fit = problem->fit({}, nullptr);
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.1);
  EXPECT_NEAR(fit.model_parameters[0].value, 4.0 / 3.5, 1e-4);
  EXPECT_NEAR(problem->validate(fit)->chi_square_per_dof(), 1.0, 0.1);
}

// The commonest missing physics is a wiring fault: said before anything is fitted, and nothing is
// searched.
TEST(PeriodicMismatch, SaysThatARobotIsWiredWrongly) {
  const auto said = [](const RecordedRobot& robot) {
    const auto problem = robot.problem();
    const Diagnosis diagnosis = diagnose(*problem);
    EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
    EXPECT_TRUE(diagnosis.effects.empty());
    std::string all;
    for (const ChannelFault& fault : diagnosis.channel_faults) all += fault.message + "\n";
    return all;
  };
  const RecordedRobot reversed("");
  reversed.change("model.yaml", "gear_ratio: 80", "gear_ratio: -80");
  EXPECT_NE(said(reversed).find("both have the wrong sign: that of the gear ratio?"),
            std::string::npos)
      << said(reversed);
  const RecordedRobot swapped("");
  swapped.change("campaign/campaign.yaml", "{name: y_1,", "{name: y_1, column: y_2,");
  swapped.change("campaign/campaign.yaml", "{name: y_2,", "{name: y_2, column: y_1,");
  EXPECT_NE(said(swapped).find("are swapped"), std::string::npos) << said(swapped);
}

// Cells of the map: p-values of noise that is estimated from few periods are uniform, too.
TEST(PeriodicMismatch, CellsOfTheMapAreNoiseWhereNothingIsMissing) {
  std::size_t cells = 0, below_5 = 0, below_1 = 0, rejected = 0;
  for (std::uint64_t seed = 31; seed < 55; ++seed) {
    const HiddenPhysics nothing("", seed);
    const std::vector<MismatchCell> map = nothing->mismatch(nothing->fit({}, nullptr));
    for (const MismatchCell& cell : map) {
      const double p_value = cell_p_value(cell);
      ++cells;
      if (p_value < 0.05) ++below_5;
      if (p_value < 0.01) ++below_1;
      EXPECT_LE(cell.effective, cell.degrees_of_freedom);
    }
    if (std::ranges::count(rejected_cells(map, 0.05), true) > 0) ++rejected;
  }
  // Three standard deviations of binomial counts.
  const auto limit = [](double rate, std::size_t of) {
    const double mean = rate * static_cast<double>(of);
    return mean + 3.0 * std::sqrt(mean * (1.0 - rate));
  };
  EXPECT_LE(static_cast<double>(below_5), limit(0.05, cells));
  EXPECT_LE(static_cast<double>(below_1), limit(0.01, cells));
  EXPECT_LE(static_cast<double>(rejected), limit(0.05, 24));
}

// Where its transition velocity is never reached, dry friction is viscous: one that the recordings
// do not tell from viscous friction is no rival of it. Of force balances frictions that never slide
// are no candidates.
TEST(PeriodicMismatch, KnowsThatSlowDryFrictionIsViscous) {
  const auto has = [](const std::string& law, bool may_creep, const std::string& special) {
    const std::vector<std::string> cases = special_cases_of(*find_law(law, false), may_creep);
    return std::ranges::find(cases, special) != cases.end();
  };
  for (const std::string law :
       {"coulomb", "stribeck", "asymmetric_coulomb", "sublinear_friction"}) {
    EXPECT_TRUE(has(law, true, "viscous")) << law;
    EXPECT_FALSE(has(law, false, "viscous")) << law;
    EXPECT_EQ(has(law, false, "coulomb"), law != "coulomb") << law;
  }
  EXPECT_FALSE(has("dahl", true, "viscous"));
}

// In these positions the bearing of joint 2 hardly shows, and the fit has a valley for each of many
// stiffnesses: from the model's values it ends in a wrong one, which another position tells at
// once.
TEST(PeriodicMismatch, ChecksAFirstFitThatDoesNotPredict) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path robot =
      std::filesystem::path(GRAYBOX_SOURCE_DIR) / "problems/robot/three_axis.yaml";
  std::filesystem::copy(robot.parent_path() / "three_axis.urdf", folder.file("three_axis.urdf"));
  const std::string text = testing::read_text(robot.string());
  std::string truth = text;
  for (const auto& [nominal, changed] : {std::pair{"4.0e4", "4.567e4"},
                                         {"5.0e4", "5.052e4"},
                                         {"1.5e4", "1.559e4"},
                                         {"8.0e4", "6.857e4"}}) {
    truth.replace(truth.find(nominal), 5, changed);
  }
  testing::write_text(folder.file("truth.yaml"), truth);
  testing::write_text(folder.file("model.yaml"), text);
  testing::write_text(folder.file("plan.yaml"), R"(format: graybox-plan/1
plant: robot
levels: [2.0, 8.0]
realisations: 1
period: 500
settling_periods: 4
periods: 4
frequencies: {from: 2, to: 62, count: 20, spacing: log}
positions: [[-124, -3, -109], [-110, 2, -118], [69, 39, -103]]
noise: 1e-5
)");
  const SimulatedSystem system = load_system(folder.file("truth.yaml"), std::nullopt);
  simulate_campaign(system, read_plan(folder.file("plan.yaml"), system), folder.file("campaign"),
                    {});
  Campaign campaign = read_campaign(folder.file("campaign"));
  for (Experiment& experiment : campaign.experiments) {
    const bool is_elsewhere = experiment.position.front() > 0.0;
    experiment.role = is_elsewhere ? ExperimentRole::kValidation : ExperimentRole::kEstimation;
  }
  const auto problem = periodic_mismatch_problem(folder.file("model.yaml"), campaign);
  const ExtendedFit fit = problem->fit({}, nullptr);
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.1);
  const LawParameterEstimate& bearing = fit.model_parameters.back();
  EXPECT_NEAR(bearing.value, 6.857 / 8.0, 4.0 * bearing.standard_error);
  EXPECT_LT(problem->predict_held_out(fit)->within_errors.chi_square_per_dof(), 1.1);
}

void expect_explained_by(const std::string& law, const std::string& place,
                         const MismatchProblem& problem, const Diagnosis& diagnosis) {
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  const Hypothesis& found = problem.hypotheses()[diagnosis.after.laws.front().hypothesis];
  EXPECT_EQ(found.place, place);
  EXPECT_EQ(found.law, law);
}

// A command that only grazes a limit says little of where it is: a limit far above with a corner
// that reaches down to the motion fits as well, and is wrong where the motion is larger.
TEST(PeriodicMismatch, FindsALimitThatTheMotionOnlyGrazes) {
  const testing::TemporaryFolder folder;
  std::string model = drive("30");
  model.replace(model.find("noise: {"), std::string::npos,
                "noise: {speed: 0.04, load_speed: 0.04}\n");
  testing::write_text(folder.file("model.yaml"), model);
  testing::write_text(folder.file("physics.yaml"),
                      element("{kind: actuator, input: torque}", "saturation",
                              "limit: {value: 1.65, unit: N m}, corner: {value: 0.01, unit: N m}"));
  testing::write_text(folder.file("plan.yaml"), R"(format: graybox-plan/1
levels: [0.3, 0.6, 1.2]
realisations: 2
period: 1000
settling_periods: 6
periods: 4
frequencies: {from: 1, to: 60, count: 40, spacing: log}
)");
  const SimulatedSystem system =
      load_system(folder.file("model.yaml"), folder.file("physics.yaml"));
  simulate_campaign(system, read_plan(folder.file("plan.yaml"), system), folder.file("campaign"),
                    {});
  Campaign campaign = read_campaign(folder.file("campaign"));
  for (Experiment& experiment : campaign.experiments) {
    experiment.role =
        experiment.level > 1.0 ? ExperimentRole::kValidation : ExperimentRole::kEstimation;
  }
  const auto problem = periodic_mismatch_problem(folder.file("model.yaml"), campaign);
  const Diagnosis diagnosis = diagnose(*problem);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  const FittedLaw& found = diagnosis.effects.front().law;
  EXPECT_EQ(problem->hypotheses()[found.hypothesis].law, "saturation");
  EXPECT_EQ(problem->hypotheses()[found.hypothesis].place, "actuator torque");
  EXPECT_NEAR(found.parameters.front().value, 1.65, 0.01 * 1.65);
  EXPECT_LT(diagnosis.validation_after->chi_square_per_dof(), 1.5);
}

// It shows in no line by itself, but the arm hangs elsewhere and its mass matrix is another one
// there.
TEST(PeriodicMismatch, NamesAConstantTorqueAtAnArm) {
  const auto torque = [](double value, const std::string& more = "") {
    return fmt::format(
        "  - name: spring\n    location: {{kind: element, joint: joint_3, axis: arm}}\n"
        "    law: offset\n    parameters: {{value: {{value: {}, unit: N m{}}}}}\n",
        value, more);
  };
  const RecordedRobot robot(torque(-60.0));
  const auto problem = robot.problem();
  const Diagnosis diagnosis = diagnose(*problem, {});
  expect_explained_by("offset", "joint_3.arm", *problem, diagnosis);
  ASSERT_FALSE(HasFailure());
  const FittedLaw& law = diagnosis.after.laws.front();
  EXPECT_NEAR(law.parameters[0].value, -60.0, 4.0 * law.parameters[0].standard_error);
  EXPECT_LT(law.parameters[0].standard_error, 6.0);
  // As an element of the model it is fitted like any other.
  const auto extended = robot.problem(torque(-20.0));
  const ExtendedFit fit = extended->fit({}, nullptr);
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.1);
  EXPECT_NEAR(fit.model_parameters.back().value, -60.0,
              4.0 * fit.model_parameters.back().standard_error);
  // Unless it is stated as fixed.
  const ExtendedFit fixed = robot.problem(torque(-20.0, ", fixed: true"))->fit({}, nullptr);
  ASSERT_TRUE(fixed.usable) << fixed.trouble;
  EXPECT_EQ(fixed.model_parameters.back().value, -20.0);
  EXPECT_GT(fixed.estimation.chi_square_per_dof(), 2.0);
}

// So strongly that the model alone fits nowhere (chi-square over its degrees of freedom above
// 10^4), with its own stiffnesses off besides.
TEST(PeriodicMismatch, NamesAGearboxThatHardensStrongly) {
  const RecordedRobot robot(
      "  - name: hidden\n    location: {kind: element, joint: joint_2, axis: gearbox}\n"
      "    law: cubic_spring\n    parameters: {stiffness: {value: 2.0e10, unit: N m/rad^3}}\n");
  const auto problem = robot.problem();
  const Diagnosis diagnosis = diagnose(*problem, {});
  EXPECT_GT(diagnosis.before.estimation.chi_square_per_dof(), 1e4);
  expect_explained_by("cubic_spring", "joint_2.gearbox", *problem, diagnosis);
  ASSERT_FALSE(HasFailure());
  EXPECT_NEAR(diagnosis.after.estimation.chi_square_per_dof(), 1.0, 0.1);
  const LawParameterEstimate& stiffness = diagnosis.after.laws.front().parameters[0];
  EXPECT_NEAR(stiffness.value, 2e10, 4.0 * stiffness.standard_error);
}

// Elsewhere than at an arm whose angle differs between positions.
TEST(PeriodicShapes, ABalancerIsTriedWhereThePlaceTurnsFarEnough) {
  CandidatePlace place;
  place.turns = true;
  place.location.units.deflection = "rad";
  const auto laws = hypothetical_laws(place, 1);
  const LawEntry* balancer = find_law("balancer", false);
  EXPECT_EQ(std::ranges::count(laws, balancer), 1);
  MotionScale scale;
  scale.range = 0.1;
  EXPECT_TRUE(periodic_shapes(*balancer, place, scale, {1.0, 60.0}).empty());
  scale.range = 1.0;
  EXPECT_FALSE(periodic_shapes(*balancer, place, scale, {1.0, 60.0}).empty());
  EXPECT_EQ(twin_of(*find_law("stiffness", false), place, 1), balancer);
  place.turns = false;
  EXPECT_EQ(std::ranges::count(hypothetical_laws(place, 1), balancer), 0);
}

// A gearbox whose torque follows the angle of its motor bends the robot by far more than the motion
// does, in each position by another amount: no line shows that, but the robot moves otherwise
// there.
TEST(PeriodicMismatch, ACouplingBendsTheRobotWhereItStands) {
  const RecordedRobot robot(
      "  - name: coupling\n    location: {kind: element, joint: joint_3, axis: gearbox, "
      "driven_by: {joint: joint_3, axis: motor}}\n    law: stiffness\n    parameters: "
      "{stiffness: {value: 5.0, unit: N m/rad}}\n",
      "[[20, 30, 40], [-60, 10, -30]]");
  const auto problem = robot.problem();
  const Diagnosis diagnosis = diagnose(*problem, {});
  expect_explained_by("stiffness", "joint_3.gearbox driven by joint_3.motor", *problem, diagnosis);
  ASSERT_FALSE(HasFailure());
  EXPECT_NEAR(diagnosis.after.estimation.chi_square_per_dof(), 1.0, 0.1);
  const LawParameterEstimate& stiffness = diagnosis.after.laws.front().parameters.front();
  EXPECT_NEAR(stiffness.value, 5.0, 4.0 * stiffness.standard_error);
}

// Over small motions about one position it is a spring; how stiff, depends on the position.
TEST(PeriodicMismatch, NamesABalancerAtAnArm) {
  const RecordedRobot robot(R"(  - name: balancer
    location: {kind: element, joint: joint_3, axis: arm}
    law: balancer
    parameters:
      stiffness: {value: 900, unit: N/m}
      free_length: {value: 0.15, unit: m}
      anchor_distance: {value: 0.41, unit: m}
      lever_length: {value: 0.2, unit: m}
      anchor_angle: {value: -1.1, unit: rad}
)",
                            "[[20, 30, 40], [-40, 10, -70]]", "1e-7");
  const auto problem = robot.problem();
  const Diagnosis diagnosis = diagnose(*problem, {});
  expect_explained_by("balancer", "joint_3.arm", *problem, diagnosis);
  ASSERT_FALSE(HasFailure());
  EXPECT_NEAR(diagnosis.after.estimation.chi_square_per_dof(), 1.0, 0.1);
  EXPECT_NEAR(diagnosis.validation_within_errors->chi_square_per_dof(), 1.0, 0.1);
}

// The joint stands at 40 degrees and moves by a thousandth of that: bristles know but how far it
// moves.
TEST(PeriodicMismatch, FindsFrictionWithMemoryAtAJointFarFromZero) {
  const RecordedRobot robot(R"(  - name: seal
    location: {kind: element, joint: joint_3, axis: arm}
    law: dahl
    parameters:
      stiffness: {value: 300, unit: N m/rad}
      level: {value: 0.03, unit: N m}
)",
                            "[[20, 30, 40]]", "1e-6");
  const auto problem = robot.problem();
  const ExtendedFit fit = problem->fit({}, nullptr);
  const auto hypotheses = problem->hypotheses();
  const auto is_seal = [](const Hypothesis& hypothesis) {
    return hypothesis.place == "joint_3.arm" && hypothesis.law == "dahl";
  };
  const auto seal = std::ranges::find_if(hypotheses, is_seal);
  ASSERT_NE(seal, hypotheses.end());
  const std::vector<std::size_t> asked{static_cast<std::size_t>(seal - hypotheses.begin())};
  const std::vector<LawStart> start{problem->scores(fit, asked, 0, 1).scores.front().start};
  const ExtendedFit extended = problem->fit(start, &fit);
  ASSERT_TRUE(extended.usable) << extended.trouble;
  EXPECT_NEAR(extended.estimation.chi_square_per_dof(), 1.0, 0.1);
  const FittedLaw& law = extended.laws.front();
  EXPECT_NEAR(law.parameters[0].value, 300.0, 4.0 * law.parameters[0].standard_error);
  EXPECT_NEAR(law.parameters[1].value, 0.03, 4.0 * law.parameters[1].standard_error);
}

TEST(PeriodicMismatch, ScoresDoNotDependOnThreads) {
  const HiddenPhysics nothing("", 3);
  const ExtendedFit fit = nothing->fit({}, nullptr);
  const auto other = nothing.problem(2);
  const auto all = nothing.all();
  const ScoreTable one = nothing->scores(fit, all, 20, 5), two = other->scores(fit, all, 20, 5);
  ASSERT_EQ(one.scores.size(), two.scores.size());
  for (std::size_t i = 0; i < one.scores.size(); ++i) {
    EXPECT_EQ(one.scores[i].score.statistic, two.scores[i].score.statistic);
  }
  EXPECT_EQ(one.null_minima, two.null_minima);
  EXPECT_EQ(fit.deviance, other->fit({}, nullptr).deviance);
}

TEST(PeriodicMismatch, RefusesWhatItCannotUse) {
  const testing::TemporaryFolder folder;
  testing::write_text(folder.file("model.yaml"), drive("30"));
  testing::write_text(folder.file("data.csv"), "time,torque\n0,1\n0.002,2\n0.004,1\n");
  testing::write_text(folder.file("campaign.yaml"),
                      "format: graybox-campaign/1\nsample_time: 0.002\nchannels:\n"
                      "  - {name: torque, unit: N m, is: input}\n"
                      "experiments:\n  - {file: data.csv}\n");
  EXPECT_THROW((void)periodic_mismatch_problem(folder.file("model.yaml"),
                                               read_campaign(folder.file("campaign.yaml"))),
               InputError);
}

}  // namespace
}  // namespace graybox
