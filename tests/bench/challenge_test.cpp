// The challenge without its command: hidden laws against the limits that they stand for,
// detectability against Monte Carlo, composition and draws, seal and scoring.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "bench/challenge/case_draw.hpp"
#include "bench/challenge/detectability.hpp"
#include "bench/challenge/make_challenge.hpp"
#include "bench/challenge/score_challenge.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
using graybox::testing::read_text;
using graybox::testing::TemporaryFolder;
using graybox::testing::write_text;

std::shared_ptr<const Law> made(const char* name, const std::vector<double>& parameters,
                                bool at_signal = false) {
  return find_hidden_law(name, at_signal)->make(parameters);
}

// The force of a law along z(t), its state integrated by the midpoint rule.
struct Motion {
  std::vector<double> deflection, rate, force;
  double step = 0.0;

  [[nodiscard]] double work_since(std::size_t start) const {
    double work = 0.0;
    for (std::size_t k = start; k < force.size(); ++k) work += force[k] * rate[k] * step;
    return work;
  }
};

template <typename Position, typename Rate>
Motion follow(const Law& law, const Position& z, const Rate& v, double duration, double step) {
  Motion motion;
  motion.step = step;
  std::vector<double> x(law.state_count()), middle(x.size()), change(x.size());
  law.rest(z(0.0), x);
  for (double t = 0.0; t < duration; t += step) {
    motion.deflection.push_back(z(t));
    motion.rate.push_back(v(t));
    motion.force.push_back(law.force(z(t), v(t), x));
    law.state_rate(z(t), v(t), x, change);
    for (std::size_t i = 0; i < x.size(); ++i) middle[i] = x[i] + 0.5 * step * change[i];
    law.state_rate(z(t + 0.5 * step), v(t + 0.5 * step), middle, change);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += step * change[i];
  }
  return motion;
}

Motion swing(const Law& law, double amplitude, double periods = 3.0) {
  constexpr double kFrequency = 2.0 * std::numbers::pi;
  return follow(
      law, [&](double t) { return amplitude * std::sin(kFrequency * t); },
      [&](double t) { return amplitude * kFrequency * std::cos(kFrequency * t); }, periods, 2e-5);
}

Motion slide(const Law& law, double rate) {
  return follow(
      law, [&](double t) { return rate * t; }, [&](double) { return rate; }, 0.5, 1e-5);
}

// ---- hidden laws --------------------------------------------------------------------------------

TEST(HiddenLaws, CoverTheCatalogueInItsOwnTerms) {
  for (const LawEntry& entry : law_catalogue()) {
    if (entry.name == "gravity") continue;  // a spring, where recordings are periodic
    const bool at_signal = entry.use == LawUse::kSignal || entry.use == LawUse::kDelay;
    const HiddenLaw* law = find_hidden_law(entry.name, at_signal);
    ASSERT_NE(law, nullptr) << entry.name;
    EXPECT_EQ(law->use, entry.use) << entry.name;
    EXPECT_EQ(law->make == nullptr, entry.make == nullptr) << entry.name;
    for (const HiddenParameter& parameter : law->parameters) {
      if (!parameter.in_catalogue) continue;
      const auto same = std::ranges::find(entry.parameters, parameter.name, &LawParameter::name);
      ASSERT_NE(same, entry.parameters.end()) << entry.name << " " << parameter.name;
      EXPECT_EQ(same->unit, parameter.unit) << entry.name << " " << parameter.name;
    }
  }
  for (const HiddenLaw& law : hidden_laws()) {
    EXPECT_EQ(law.in_catalogue, find_law(law.name, law.at_signal()) != nullptr) << law.name;
  }
}

TEST(HiddenLaws, RoundedCornersApproachSharpOnes) {
  constexpr double kGap = 0.3, kStiffness = 7.0;
  for (const double corner : {1e-2, 1e-4}) {
    const auto play = made("backlash", {kGap, kStiffness, corner});
    const auto zone = made("dead_zone", {kGap, kStiffness, corner});
    const auto limit = made("saturation", {kGap, corner}, true);
    const auto band = made("dead_zone", {kGap, corner}, true);
    for (double z = -1.0; z <= 1.0; z += 0.0625) {
      const double clipped = std::clamp(z, -kGap, kGap);
      EXPECT_NEAR(play->force(z, 0.0, {}), -kStiffness * clipped, kStiffness * corner) << z;
      EXPECT_NEAR(zone->force(z, 0.0, {}), kStiffness * (z - clipped), kStiffness * corner) << z;
      EXPECT_NEAR(limit->force(z, 0.0, {}), clipped - z, corner) << z;
      EXPECT_NEAR(band->force(z, 0.0, {}), -clipped, corner) << z;
    }
  }
}

TEST(HiddenLaws, SmallHigherTermsVanishWithTheirShare) {
  const auto cubic = made("cubic_spring", {5.0, 1.0, 0.0});
  EXPECT_DOUBLE_EQ(cubic->force(0.3, 0.0, {}), 5.0 * 0.027);
  const auto ripple = made("ripple", {2.0, 0.5, 0.4, 0.0});
  EXPECT_NEAR(ripple->force(0.1, 0.0, {}), 2.0 * std::sin(0.4 * std::numbers::pi + 0.4), 1e-12);
}

TEST(HiddenLaws, BalancerIsTheSlopeOfItsSpringsEnergy) {
  const std::vector<double> p{4e3, 0.2, 0.5, 0.3, 0.7};
  const auto law = made("balancer", p);
  const auto energy = [&](double z) {
    const double length =
        std::sqrt(p[2] * p[2] + p[3] * p[3] - 2.0 * p[2] * p[3] * std::cos(z - p[4]));
    return 0.5 * p[0] * std::pow(length - p[1], 2);
  };
  for (double z = -3.0; z < 3.0; z += 0.37) {
    EXPECT_NEAR(law->force(z, 0.0, {}), (energy(z + 1e-6) - energy(z - 1e-6)) / 2e-6, 1e-4) << z;
  }
}

TEST(HiddenLaws, FrictionSlidesAtTheLevelsOfItsLaws) {
  for (const double rate : {-2.0, -0.05, 0.05, 2.0}) {
    const double side = rate > 0.0 ? 1.0 : -1.0;
    EXPECT_NEAR(slide(*made("coulomb", {3.0, 1e-5}), rate).force.back(), 3.0 * side, 1e-6);
    EXPECT_NEAR(slide(*made("asymmetric_coulomb", {3.0, 1.0, 1e-5}), rate).force.back(),
                rate > 0.0 ? 3.0 : -1.0, 1e-6);
    const double stribeck = 3.0 + 2.0 * std::exp(-std::pow(rate / 0.1, 2));
    EXPECT_NEAR(slide(*made("stribeck", {3.0, 5.0, 0.1, 1e-5}), rate).force.back(), side * stribeck,
                1e-6);
    EXPECT_NEAR(slide(*made("lugre", {3e3, 0.0, 0.5, 3.0, 5.0, 0.1}), rate).force.back(),
                side * stribeck + 0.5 * rate, 1e-6);
    EXPECT_NEAR(slide(*made("dahl", {3e3, 3.0}), rate).force.back(), 3.0 * side, 1e-6);
  }
}

// Before they yield, Dahl's and Bouc-Wen's laws are springs; far beyond, they hold their yield
// force.
TEST(HiddenLaws, MemoriesAreSpringsFirst) {
  for (const auto& law : {made("dahl", {40.0, 2.0}), made("bouc_wen", {40.0, 0.05, 2.0, 0.7})}) {
    const Motion motion = slide(*law, 1e-3);
    EXPECT_NEAR(motion.force.back(), 40.0 * motion.deflection.back(), 0.02 * motion.force.back());
    EXPECT_NEAR(slide(*law, 2.0).force.back(), 2.0, 1e-3);
  }
}

// A slider behind slack: soft within the gap, then stiff, then sliding at its level.
TEST(HiddenLaws, SlackSliderIsAPlayThatSlips) {
  const auto law = made("play_and_slip", {200.0, 50.0, 0.03, 10.0, 4.0, 1e-5});
  EXPECT_NEAR(slide(*law, 0.02).force.back(), 50.0 * 0.01, 1e-3);
  EXPECT_NEAR(slide(*law, 0.08).force.back(), 50.0 * 0.03 + 200.0 * 0.01, 0.02);
  EXPECT_NEAR(slide(*law, -2.0).force.back(), -10.0, 1e-6);
}

// The absorber's force is that of a mass on a spring and damper: far below its frequency an
// inertia.
TEST(HiddenLaws, AbsorberIsAnInertiaAtLowFrequency) {
  const Motion motion = swing(*made("mode", {0.2, 40.0, 0.3}), 0.01, 3.0);
  const double square = std::pow(2.0 * std::numbers::pi, 2);
  for (std::size_t k = motion.force.size() / 2; k < motion.force.size(); k += 500) {
    EXPECT_NEAR(motion.force[k], -0.2 * square * motion.deflection[k], 0.02 * 0.2 * square * 0.01);
  }
}

TEST(HiddenLaws, FrictionTakesEnergyAndSpringsKeepIt) {
  for (const HiddenLaw& law : hidden_laws()) {
    const std::set<std::string> others{"offset", "drifting_stiffness", "mode"};
    if (law.use != LawUse::kForce || others.contains(law.name)) {
      continue;
    }
    PlaceScale scale{.deflection = 0.1,
                     .offset = 0.02,
                     .rate = 0.6,
                     .acceleration = 4.0,
                     .force = 2.0,
                     .stiffness = 20.0,
                     .turns = false};
    const std::array<double, 6> shape{0.6, 0.4, 0.5, 0.5, 0.5, 0.5};
    const auto made_law = law.make(law.parameters_of(0.5, scale, shape));
    const Motion motion = swing(*made_law, 0.15);
    const double work = motion.work_since(motion.force.size() / 3);  // two periods
    const std::set<std::string> conservative{"stiffness",      "cubic_spring", "backlash",
                                             "dead_zone",      "ripple",       "balancer",
                                             "magnetic_spring"};
    if (conservative.contains(law.name)) {
      EXPECT_NEAR(work, 0.0, 1e-3) << law.name;
    } else {
      EXPECT_GT(work, 1e-5) << law.name;
    }
  }
}

// ---- detectability ------------------------------------------------------------------------------

// On r = J x + effect + noise the lack of fit after least squares is chi-square with the
// non-centrality that left_over() says.
TEST(Detectability, NoncentralityAndPowerAgreeWithMonteCarlo) {
  constexpr int kNumbers = 30, kParameters = 3, kDraws = 4000;
  Random random(5);
  Eigen::MatrixXd jacobian(kNumbers, kParameters);
  Eigen::VectorXd effect(kNumbers);
  for (double& value : jacobian.reshaped()) value = random.normal();
  for (double& value : effect) value = random.normal();
  const double dof = kNumbers - kParameters, required = required_noncentrality(dof);
  effect *= std::sqrt(required / left_over(effect, jacobian));
  effect += 7.0 * jacobian.col(1);  // what the fit takes away
  EXPECT_NEAR(left_over(effect, jacobian), required, 1e-8 * required);
  const double threshold = chi_square_quantile(1.0 - kDetectionLevel, dof);
  int detected = 0, false_alarms = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    Eigen::VectorXd noise(kNumbers);
    for (double& value : noise) value = random.normal();
    if (left_over(effect + noise, jacobian) > threshold) ++detected;
    if (left_over(noise, jacobian) > threshold) ++false_alarms;
  }
  EXPECT_NEAR(detected / double{kDraws}, kDetectionPower, 0.02);
  EXPECT_NEAR(false_alarms / double{kDraws}, kDetectionLevel, 0.015);
}

TEST(Detectability, OneDegreeOfFreedomNeedsTheDirectedNoncentrality) {
  EXPECT_NEAR(required_noncentrality(1.0), kDirectedNoncentrality, 0.02);
}

// A rotor with viscous friction: v(t+1) = a v(t) + (1 - a) u(t) / d, a = exp(-d T_s / J).
TEST(Detectability, ResponseIsThatOfTheSampledSystem) {
  const auto system = draw_system(Family::kOneMass, 3);
  const LinearDynamics dynamics = system->linear(0);
  const double sample_time = system->plan().sample_time;
  const double inertia = dynamics.mass(0, 0), damping = dynamics.damping(0, 0);
  const auto closed_form = [&](double j, double d, double w) {
    const double decay = std::exp(-d * sample_time / j);
    return (1.0 - decay) / d / (std::polar(1.0, w * sample_time) - decay);
  };
  const SampledDynamics sampled(dynamics, sample_time);
  for (const double w : {3.0, 40.0, 600.0}) {
    const ResponseAt at = sampled.at(w);
    const std::complex<double> expected = closed_form(inertia, damping, w);
    EXPECT_LT(std::abs(at.response(0, 0) - expected), 1e-10 * std::abs(expected));
    const double step = 1e-4;
    const auto by_inertia = (closed_form(inertia * (1.0 + step), damping, w) -
                             closed_form(inertia * (1.0 - step), damping, w)) /
                            (2.0 * step);
    EXPECT_LT(std::abs(at.derivatives[0](0, 0) - by_inertia), 1e-5 * std::abs(expected));
    // Twice all masses, stiffnesses and dampings halve G: what an actuator's gain does is taken up.
    EXPECT_LT(std::abs(at.derivatives[0](0, 0) + at.derivatives[1](0, 0) + expected),
              1e-6 * std::abs(expected));
  }
}

const ChallengePlace& place_named(const CaseSystem& system, const std::string& name) {
  return *std::ranges::find_if(
      system.places(), [&](const ChallengePlace& place) { return place.location.name == name; });
}

double noncentrality_of(const Detectability& detectability, const CaseSystem& system,
                        const char* law, const char* place, double value) {
  return detectability.noncentrality(
      {element_of(*find_hidden_law(law, false), place_named(system, place), {value})});
}

// What the fit can take up is not detectable, what it can't grows with the square of its size.
TEST(Detectability, SeesWhatTheFittedParametersCannotTakeUp) {
  const auto system = draw_system(Family::kTwoMass, 7);
  const Detectability detectability(*system, 7);
  const double damping = 0.02 * system->linear(0).damping(1, 1);
  const double fitted = noncentrality_of(detectability, *system, "viscous", "load", damping);
  const double seen = noncentrality_of(detectability, *system, "viscous", "motor", damping);
  const double doubled =
      noncentrality_of(detectability, *system, "viscous", "motor", 2.0 * damping);
  EXPECT_LT(fitted, 0.02 * seen);
  // A gain that masses and dampings can take up, but for the loop's answer to it.
  const double gain = detectability.noncentrality({element_of(
      *find_hidden_law("gain", true), place_named(*system, "actuator force_motor"), {0.1})});
  EXPECT_LT(gain, 1e-3 * required_noncentrality(detectability.degrees_of_freedom()));
  EXPECT_NEAR(doubled / seen, 4.0, 0.3);
}

TEST(ChallengeComposition, AddsNothingToWhatIsFitted) {
  for (const Family family :
       {Family::kOneMass, Family::kTwoMass, Family::kOscillator, Family::kChain}) {
    const auto system = draw_system(family, 1);
    for (const LawAtPlace& pair : possible_effects(*system, true)) {
      const ChallengePlace& place = system->places()[pair.place];
      const LinearDynamics dynamics = system->linear(0);
      const bool is_stiffness = pair.law->name == "stiffness";
      if (!is_stiffness && pair.law->name != "viscous") continue;
      const Eigen::VectorXd& b = place.location.input;
      for (const auto& change : dynamics.derivatives) {
        const Eigen::MatrixXd& fitted = is_stiffness ? change.stiffness : change.damping;
        if (fitted.size() == 0) continue;
        const double along = b.dot(fitted * b) / b.squaredNorm();
        EXPECT_GT((fitted - along * b * b.transpose() / b.squaredNorm()).norm(),
                  1e-9 * fitted.norm())
            << pair.law->name << " at " << place.location.name;
      }
    }
  }
}

// ---- composition and draws ----------------------------------------------------------------------

TEST(ChallengeComposition, HasTheSharesPromised) {
  const auto outlines = compose_challenge(400, 11);
  std::map<CaseKind, int> kinds;
  int robots = 0;
  std::set<std::string> laws, places;
  const auto robot = draw_system(Family::kRobot, 1);
  for (const CaseOutline& outline : outlines) {
    ++kinds[outline.kind];
    robots += outline.family == Family::kRobot ? 1 : 0;
    for (const LawAtPlace& effect : outline.effects) {
      laws.insert(effect.law->name + (effect.law->at_signal() ? " signal" : ""));
      if (outline.family == Family::kRobot) {
        places.insert(robot->places()[effect.place].location.name);
      }
    }
  }
  EXPECT_EQ(kinds[CaseKind::kNothing], 100);
  EXPECT_EQ(kinds[CaseKind::kTwoEffects], 40);
  EXPECT_EQ(kinds[CaseKind::kOutside], 30);
  EXPECT_EQ(robots, 120);
  EXPECT_EQ(laws.size(), hidden_laws().size());
  EXPECT_EQ(places.size(), robot->places().size());
}

TEST(ChallengeComposition, OrderTellsNothing) {
  // Neighbours in the list are not alike more often than by chance: 6 families, 4 kinds.
  const auto outlines = compose_challenge(400, 12);
  int same_family = 0, same_kind = 0;
  for (std::size_t k = 1; k < outlines.size(); ++k) {
    same_family += outlines[k].family == outlines[k - 1].family ? 1 : 0;
    same_kind += outlines[k].kind == outlines[k - 1].kind ? 1 : 0;
  }
  EXPECT_NEAR(same_family, 399 * (0.09 + 0.04 + 4 * 0.0156), 40);
  EXPECT_NEAR(same_kind, 399 * (0.0625 + 0.33 + 0.01 + 0.0056), 45);
}

TEST(ChallengeDraw, DependsOnTheSeedAloneAndIsDetectable) {
  const auto system = draw_system(Family::kOneMass, 1);
  const auto possible = possible_effects(*system, true);
  const auto drag = std::ranges::find_if(
      possible, [](const LawAtPlace& pair) { return pair.law->name == "quadratic_drag"; });
  ASSERT_NE(drag, possible.end());
  const CaseOutline outline{"case_001", Family::kOneMass, CaseKind::kOneEffect, 5, {*drag}};
  const CaseTruth truth = draw_case(outline);
  EXPECT_EQ(to_json(truth), to_json(draw_case(outline)));
  ASSERT_FALSE(truth.effects.empty());
  for (const HiddenEffect& effect : truth.effects) {
    if (effect.law == "offset") continue;
    EXPECT_TRUE(effect.detectable);
    EXPECT_GE(effect.relative_size(), 0.999);
    EXPECT_LE(effect.relative_size(), 20.0);
  }
  for (const double factor : truth.parameter_factors) EXPECT_NEAR(factor, 1.0, 0.2);
  EXPECT_EQ(to_json(truth_from_json(to_json(truth), "file")), to_json(truth));
}

// ---- seal and cases -----------------------------------------------------------------------------

HiddenEffect effect_of(const std::string& place, const std::string& law, double value) {
  HiddenEffect effect{place, law};
  effect.at_signal = place.starts_with("actuator") || place.starts_with("sensor");
  for (const HiddenParameter& parameter : find_hidden_law(law, effect.at_signal)->parameters) {
    effect.parameters.push_back({parameter.name, "N m", value, parameter.in_catalogue});
  }
  effect.size = 2.0;
  effect.smallest_size = 1.0;
  effect.detectable = true;
  return effect;
}

CaseTruth truth_with(const std::string& name, CaseKind kind, std::vector<HiddenEffect> effects) {
  CaseTruth truth;
  truth.name = name;
  truth.family = Family::kOneMass;
  truth.kind = kind;
  truth.seed = 9;
  truth.effects = std::move(effects);
  return truth;
}

TEST(ChallengeCase, FilesTellNothingOfTheContent) {
  const TemporaryFolder folder;
  HiddenEffect friction = effect_of("rotor", "coulomb", 1e-3);
  ASSERT_TRUE(write_case(truth_with("a", CaseKind::kNothing, {}), folder.file("a")));
  ASSERT_TRUE(write_case(truth_with("b", CaseKind::kOneEffect, {friction}), folder.file("b")));
  CaseTruth other = truth_with("c", CaseKind::kNothing, {});
  other.seed = 10;
  ASSERT_TRUE(write_case(other, folder.file("c")));
  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder.file("a"))) {
    if (!entry.is_regular_file()) continue;
    ++files;
    const fs::path name = fs::relative(entry.path(), folder.file("a"));
    for (const char* twin : {"b", "c"}) {
      EXPECT_EQ(fs::file_size(folder.file(twin) / name), entry.file_size()) << name;
    }
  }
  EXPECT_EQ(files, 8U);  // model, campaign, six recordings
  EXPECT_NE(read_text(folder.file("a/campaign/p1_l1_r1_e1.h5")),
            read_text(folder.file("b/campaign/p1_l1_r1_e1.h5")));
  EXPECT_EQ(read_text(folder.file("a/model.yaml")), read_text(folder.file("b/model.yaml")));
}

TEST(Seal, BreaksWithEveryChange) {
  const TemporaryFolder folder;
  const CaseTruth truth =
      truth_with("case_001", CaseKind::kOneEffect, {effect_of("rotor", "coulomb", 0.1)});
  write_text(folder.file("case_001.json"), to_json(truth).dump());
  const std::string sha256 = seal_truth(folder.file(""), {1, "", 1, ""}, {"case_001"});
  write_header(folder.file(""), {1, sha256});
  const ChallengeHeader header = read_header(folder.file(""));
  EXPECT_EQ(unseal(folder.file(""), header).cases.size(), 1U);
  write_text(folder.file("case_001.json"), to_json(truth).dump() + " ");
  EXPECT_THROW((void)unseal(folder.file(""), header), InputError);
  (void)seal_truth(folder.file(""), {1, "", 1, ""}, {"case_001"});
  EXPECT_THROW((void)unseal(folder.file(""), header), InputError);
}

TEST(Seal, SeedOfACommitIsItsSha256) {
  // SHA-256 of "abc" begins with ba7816bf 8f01cfea (FIPS 180-2).
  EXPECT_EQ(seed_of_commit("abc"), 0xba7816bf8f01cfeaULL);
}

// ---- scoring ------------------------------------------------------------------------------------

TEST(Score, OnlyWholeRunsEnterTheHistory) {
  const testing::TemporaryFolder folder;
  Score score;
  score.origin.commit = std::string(40, 'a');
  score.origin.seed = seed_of_commit(score.origin.commit);
  append_history(score, folder.file("history.csv"));
  const std::string before = testing::read_text(folder.file("history.csv"));
  score.not_run = 1;
  EXPECT_THROW(append_history(score, folder.file("history.csv")), InputError);
  EXPECT_EQ(testing::read_text(folder.file("history.csv")), before);
  score.not_run = 0;
  testing::write_text(folder.file("other.csv"), "date,commit\n");
  EXPECT_THROW(append_history(score, folder.file("other.csv")), InputError);
}

// Without the law that is there: `unknown`, or one that holds on recordings kept out, or says that
// it does not.
TEST(Score, NearestLawsMustHoldOnWhatWasKeptOut) {
  const CaseTruth truth =
      truth_with("a", CaseKind::kOneEffect, {effect_of("load", "coulomb", 0.5)});
  const auto is_honest = [&](const char* verdict, double validation, bool predicts = true) {
    Answer answer;
    answer.given = true;
    answer.verdict = verdict;
    answer.effects = {{{"load", "viscous", {}}}};
    answer.validation = validation;
    answer.predicts = predicts;
    Score score;
    score.left_out = {score_case(truth, answer), score_case(truth, Answer{})};
    const auto rates = rates_of(score);
    const auto found = std::ranges::find(rates, "left_out_honest", &NamedRate::name);
    EXPECT_EQ(found->rate.of, 1U);
    return found->rate.hits == 1;
  };
  EXPECT_TRUE(is_honest("unknown", 3.0));
  EXPECT_FALSE(is_honest("none", 1.0));
  for (const char* verdict : {"explained", "ambiguous"}) {
    EXPECT_TRUE(is_honest(verdict, 1.05));
    EXPECT_FALSE(is_honest(verdict, 1.3));
    EXPECT_TRUE(is_honest(verdict, 1.3, false));
  }
}

TEST(Score, WilsonIntervalsSolveTheirEquation) {
  const double z = normal_quantile(0.975);
  for (const Rate rate : {Rate{0, 10}, Rate{3, 10}, Rate{95, 100}, Rate{100, 100}}) {
    const double p = rate.value(), n = static_cast<double>(rate.of);
    const Interval interval = wilson_interval(rate);
    for (const double end : {interval.low, interval.high}) {
      EXPECT_NEAR((p - end) * (p - end), z * z * end * (1.0 - end) / n, 1e-12);
    }
  }
  EXPECT_EQ(wilson_interval({0, 0}).low, 0.0);
  EXPECT_EQ(wilson_interval({0, 0}).high, 1.0);
}

AnsweredLaw named(const std::string& place, const std::string& law, double value = 0.0,
                  double error = 1.0) {
  return {place, law, {{"level", {value, error}}}};
}

Answer answer_of(const std::string& verdict, std::vector<std::vector<AnsweredLaw>> effects) {
  return {true, verdict, std::move(effects), 1.0, 1.0};
}

TEST(Score, OutcomesOfOneEffect) {
  const CaseTruth truth =
      truth_with("a", CaseKind::kOneEffect, {effect_of("load", "coulomb", 0.5)});
  const auto right = named("load", "coulomb", 0.4, 0.05), wrong = named("motor", "coulomb");
  const auto outcome = [&](const char* verdict, std::vector<std::vector<AnsweredLaw>> effects) {
    return score_case(truth, answer_of(verdict, std::move(effects))).outcome;
  };
  EXPECT_EQ(outcome("explained", {{right}}), "right");
  EXPECT_EQ(outcome("ambiguous", {{wrong, right, wrong}}), "in_class");
  EXPECT_EQ(outcome("ambiguous", {{wrong, right, wrong, wrong}}), "in_large_class");
  EXPECT_EQ(outcome("explained", {{right}, {wrong}}), "in_class");
  EXPECT_EQ(outcome("explained", {{wrong}}), "wrong_confident");
  EXPECT_EQ(outcome("ambiguous", {{wrong, wrong}}), "wrong_ambiguous");
  EXPECT_EQ(outcome("unknown", {{right}}), "unknown");
  EXPECT_EQ(outcome("none", {}), "none");
  EXPECT_EQ(score_case(truth, Answer{}).outcome, "no_answer");
  const ScoredCase two_errors_off = score_case(truth, answer_of("explained", {{right}}));
  EXPECT_EQ(two_errors_off.parameters, 1U);
  EXPECT_EQ(two_errors_off.within_three, 1U);
  const ScoredCase far =
      score_case(truth, answer_of("explained", {{named("load", "coulomb", 0.3, 0.05)}}));
  EXPECT_EQ(far.within_three, 0U);
}

TEST(Score, CountsUndeterminedParametersApart) {
  const CaseTruth truth =
      truth_with("a", CaseKind::kOneEffect, {effect_of("load", "coulomb", 0.5)});
  const ScoredCase scored = score_case(
      truth,
      answer_of("explained",
                {{named("load", "coulomb", 9.0, std::numeric_limits<double>::quiet_NaN())}}));
  EXPECT_EQ(scored.outcome, "right");
  EXPECT_EQ(scored.parameters, 0U);
  EXPECT_EQ(scored.undetermined, 1U);
}

TEST(Score, ComparesAnglesOnTheCircle) {
  HiddenEffect effect = effect_of("load", "ripple", 3.1);
  effect.parameters = {{"phase", "rad", 3.1, true}};
  const CaseTruth truth = truth_with("a", CaseKind::kOneEffect, {effect});
  for (const double phase : {-3.15, 3.1 - 2.0 * std::numbers::pi, 2.9}) {
    const Answer answer =
        answer_of("explained", {{{"load", "ripple", {{"phase", {phase, 0.05}}}}}});
    EXPECT_EQ(score_case(truth, answer).within_three, phase < 0.0 ? 1U : 0U) << phase;
  }
}

// Strictly each place is a member of a class; as systems, places that make one count once.
TEST(Score, CountsPlacesOfOneSystemBothWays) {
  const CaseTruth truth =
      truth_with("a", CaseKind::kOneEffect, {effect_of("sensor y", "saturation", 0.5)});
  const auto place = [](const char* name, const char* law, bool is_same) {
    AnsweredLaw answered = named(name, law);
    answered.is_same_system = is_same;
    return answered;
  };
  const Answer answer =
      answer_of("ambiguous",
                {{place("actuator u", "saturation", false), place("sensor y", "saturation", true),
                  place("actuator u", "dead_zone", false), place("sensor y", "dead_zone", true)}});
  const ScoredCase scored = score_case(truth, answer);
  EXPECT_EQ(scored.outcome, "in_large_class");
  EXPECT_EQ(scored.class_size, 4U);
  EXPECT_EQ(scored.systems, 2U);
  EXPECT_TRUE(scored.named_as_system);
  Answer extra = answer;
  extra.effects.push_back({named("motor", "viscous")});
  EXPECT_FALSE(score_case(truth, extra).named_as_system);
  Answer open = answer;
  open.verdict = "unknown";
  EXPECT_FALSE(score_case(truth, open).named_as_system);
  Answer other = answer;
  other.effects[0].erase(other.effects[0].begin() + 1);
  EXPECT_FALSE(score_case(truth, other).named_as_system);
}

TEST(Score, ReadsPlacesOfOneSystemFromAVerdict) {
  const testing::TemporaryFolder folder;
  testing::write_text(folder.file("run.json"), R"({"status": "answered", "seconds": 1.0})");
  testing::write_text(folder.file("verdict.json"), R"({"verdict": "ambiguous", "physics": [
    {"place": "actuator u", "law": "delay",
     "parameters": {"time": {"value": 1e-3, "standard_error": 1e-5}},
     "same_at": [{"place": "sensor y",
                  "parameters": {"time": {"value": 1.1e-3, "standard_error": 1e-5}}}],
     "alternatives": [
       {"place": "actuator u", "law": "lag", "same_at": [],
        "parameters": {"time_constant": {"value": 1e-3, "standard_error": 1e-5}}},
       {"place": "actuator u", "law": "offset", "parameters": {}}]}]})");
  const Answer answer = read_answer(folder.file(""));
  ASSERT_EQ(answer.effects.size(), 1U);
  const std::vector<AnsweredLaw>& members = answer.effects[0];
  ASSERT_EQ(members.size(), 4U);
  EXPECT_EQ(members[1].place, "sensor y");
  EXPECT_EQ(members[1].law, "delay");
  EXPECT_EQ(members[1].parameters.at("time").value, 1.1e-3);
  const std::vector<bool> same{false, true, false, true};
  for (std::size_t m = 0; m < 4; ++m) EXPECT_EQ(members[m].is_same_system, same[m]) << m;
}

TEST(Score, OutcomesOfTheOtherKinds) {
  const CaseTruth two =
      truth_with("a", CaseKind::kTwoEffects,
                 {effect_of("load", "coulomb", 0.5), effect_of("motor", "coulomb", 0.5)});
  const auto load = named("load", "coulomb"), motor = named("motor", "coulomb");
  EXPECT_EQ(score_case(two, answer_of("explained", {{motor}, {load}})).outcome, "both");
  EXPECT_EQ(score_case(two, answer_of("explained", {{motor, load}})).outcome, "one");
  EXPECT_EQ(score_case(two, answer_of("unknown", {{motor}, {load}})).outcome, "unknown");
  const CaseTruth nothing = truth_with("b", CaseKind::kNothing, {});
  EXPECT_EQ(score_case(nothing, answer_of("none", {})).outcome, "right");
  EXPECT_EQ(score_case(nothing, answer_of("unknown", {})).outcome, "false_alarm");
  const CaseTruth outside =
      truth_with("c", CaseKind::kOutside, {effect_of("load", "magnetic_spring", 1.0)});
  EXPECT_EQ(score_case(outside, answer_of("unknown", {{load}})).outcome, "unknown");
  EXPECT_EQ(score_case(outside, answer_of("explained", {{load}})).outcome, "nearest_law");
  Answer fails = answer_of("ambiguous", {{load}});
  EXPECT_EQ(score_case(outside, fails).outcome, "nearest_law");
  fails.predicts = false;
  EXPECT_EQ(score_case(outside, fails).outcome, "nearest_law_fails");
  // Of an effect of the catalogue it changes nothing.
  const CaseTruth one = truth_with("d", CaseKind::kOneEffect, {effect_of("load", "coulomb", 0.5)});
  EXPECT_EQ(score_case(one, fails).outcome,
            score_case(one, answer_of("ambiguous", {{load}})).outcome);
}

TEST(Score, RatesCountWhatTheyName) {
  Score score;
  const auto truth = truth_with("a", CaseKind::kOneEffect, {effect_of("load", "coulomb", 0.5)});
  const auto nothing = truth_with("b", CaseKind::kNothing, {});
  for (int k = 0; k < 8; ++k) {
    const bool is_right = k < 6;
    score.cases.push_back(score_case(
        truth,
        answer_of("explained", {{named(is_right ? "load" : "motor", "coulomb", 0.5, 0.1)}})));
    score.cases.push_back(score_case(nothing, answer_of(k < 1 ? "ambiguous" : "none", {})));
  }
  score.cases.push_back(score_case(truth, Answer{}));
  std::map<std::string, Rate> rates;
  for (const NamedRate& each : rates_of(score)) rates[each.name] = each.rate;
  const auto expect = [&](const char* name, std::size_t hits, std::size_t of) {
    EXPECT_EQ(rates[name].hits, hits) << name;
    EXPECT_EQ(rates[name].of, of) << name;
  };
  expect("answered", 16, 17);
  expect("false_alarms", 1, 8);
  expect("detectable_named", 6, 9);
  expect("wrong_and_confident", 2, 9);
  expect("parameters_within_3", 6, 6);
  expect("explained_at_noise_floor", 8, 8);
}

}  // namespace
}  // namespace graybox::bench
