// The gate of physical sanity, rule by rule: what violates it is caught, and what a machine has is
// not.
#include "diagnosis/plausibility/plausibility.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "diagnosis/estimation/fit_report.hpp"
#include "diagnosis/inverse_dynamics/base_parameters.hpp"
#include "diagnosis/plausibility/plausibility_words.hpp"
#include "problems/base/random.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {
namespace {

PhysicalQuantity quantity(QuantityKind kind, double value, double error) {
  PhysicalQuantity result;
  result.name = words_of(kind);
  result.unit = "1";
  result.kind = kind;
  result.value = value;
  result.standard_error = error;
  return result;
}

FittedPhysics with(PhysicalQuantity each) {
  FittedPhysics physics;
  physics.quantities.push_back(std::move(each));
  return physics;
}

bool has(const std::vector<Implausibility>& flaws, PlausibilityRule rule, bool excludes = true) {
  return std::ranges::any_of(flaws, [&](const Implausibility& flaw) {
    return flaw.rule == rule && flaw.excludes == excludes;
  });
}

// A law along one swing, z = sin, with what it gives and, of that, what the deflection alone sets.
template <typename Force>
LawTrace swing(const std::string& name, Force force, double amplitude = 1.0) {
  LawTrace trace;
  trace.name = name;
  trace.place = "load";
  trace.carried = 10.0;
  for (int t = 0; t < 400; ++t) {
    const double angle = 2.0 * std::numbers::pi * t / 400.0;
    const double z = amplitude * std::sin(angle), rate = amplitude * std::cos(angle);
    trace.deflection.push_back(z);
    trace.rate.push_back(rate);
    trace.force.push_back(force(z, rate));
    trace.conservative.push_back(force(z, 0.0));
  }
  return trace;
}

constexpr QuantityKind kOfOneSign[] = {QuantityKind::kMass, QuantityKind::kInertia,
                                       QuantityKind::kStiffness, QuantityKind::kDamping,
                                       QuantityKind::kFriction};

TEST(Plausibility, ExcludesWhatIsNegativeByMoreThanItsError) {
  for (const QuantityKind kind : kOfOneSign) {
    const auto flaws = implausibilities(with(quantity(kind, -1.0, 0.1)));
    ASSERT_EQ(flaws.size(), 1U) << words_of(kind);
    EXPECT_EQ(flaws[0].rule, PlausibilityRule::kSign);
    EXPECT_TRUE(flaws[0].excludes);
    EXPECT_NEAR(flaws[0].standard_errors, 10.0, 1e-9);
    EXPECT_FALSE(flaws[0].remedy.empty());
    EXPECT_NE(plausibility_lines(flaws)[0].find(words_of(kind)), std::string::npos);
    EXPECT_TRUE(implausibilities(with(quantity(kind, 1.0, 0.1))).empty()) << words_of(kind);
  }
  EXPECT_TRUE(implausibilities(with(quantity(QuantityKind::kForce, -1.0, 0.1))).empty());
  EXPECT_TRUE(implausibilities(with(quantity(QuantityKind::kOther, -1.0, 0.1))).empty());
}

// A wrist that its bodies hardly load says little of the arm, but its drive's gain is not told.
TEST(Plausibility, SaysWhichDriveHasANegativeGain) {
  const auto flaws = implausibilities(with(quantity(QuantityKind::kGain, -1.0, 0.1)));
  ASSERT_EQ(flaws.size(), 1U);
  EXPECT_EQ(flaws[0].rule, PlausibilityRule::kSign);
  EXPECT_FALSE(flaws[0].excludes);
  EXPECT_NE(flaws[0].remedy.find("gravity points elsewhere"), std::string::npos);
  for (const double error : {0.5, 2.0, std::nan("")})
    EXPECT_TRUE(implausibilities(with(quantity(QuantityKind::kGain, -1.0, error))).empty());
  EXPECT_TRUE(implausibilities(with(quantity(QuantityKind::kGain, 1.0, 0.1))).empty());
  EXPECT_EQ(base_parameter_kind("1/gain_2", "1", {}), QuantityKind::kGain);
}

TEST(Plausibility, SaysWhatItsErrorDoesNotTellFromZeroIsNotDetermined) {
  for (const double value : {0.05, -0.05, 1e-13}) {
    const auto flaws = implausibilities(with(quantity(QuantityKind::kDamping, value, 0.1)));
    ASSERT_EQ(flaws.size(), 1U) << value;
    EXPECT_EQ(flaws[0].rule, PlausibilityRule::kZero);
    EXPECT_FALSE(flaws[0].excludes);
    EXPECT_EQ(excluding(flaws), 0U);
  }
  const auto unseen =
      implausibilities(with(quantity(QuantityKind::kMass, -2.0, PhysicalQuantity::kNone)));
  EXPECT_TRUE(has(unseen, PlausibilityRule::kZero, false));
}

// By fewer errors than exclude it, but no machine has it: such a size is never silent.
TEST(Plausibility, TellsEachSizeBelowZero) {
  for (const QuantityKind kind : kOfOneSign) {
    const auto flaws = implausibilities(with(quantity(kind, -2.0, 1.0)));
    ASSERT_EQ(flaws.size(), 1U) << words_of(kind);
    EXPECT_EQ(flaws[0].rule, PlausibilityRule::kZero);
    EXPECT_FALSE(flaws[0].excludes);
    EXPECT_NE(flaws[0].words.find("below zero by 2 standard errors"), std::string::npos)
        << flaws[0].words;
    EXPECT_TRUE(implausibilities(with(quantity(kind, 2.0, 1.0))).empty());
  }
}

// A spring that rests ten amplitudes from the zero of its sensor: the constant force beside it is
// ten times what the spring ever carries.
TEST(Plausibility, LetsAConstantForceSayWhereASpringRests) {
  FittedPhysics physics;
  const auto about = [](double z, double) { return 10.0 * (z + 10.0); };
  physics.laws = {swing("stiffness at load", about),
                  swing("offset at load", [](double, double) { return -100.0; })};
  physics.quantities = {quantity(QuantityKind::kStiffness, 10.0, 0.1),
                        quantity(QuantityKind::kForce, -100.0, 1.0)};
  physics.quantities[0].law = 0;
  physics.quantities[1].law = 1;
  EXPECT_TRUE(implausibilities(physics).empty());
  physics.laws[0].name = "cubic_spring at load";
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kPair));
}

TEST(Plausibility, AllowsAnErrorOfWhatTheModelStates) {
  PhysicalQuantity softer = quantity(QuantityKind::kStiffness, -20.0, 1.0);
  softer.stated = 100.0;
  EXPECT_TRUE(implausibilities(with(softer)).empty());
  softer.stated = 10.0;
  EXPECT_TRUE(has(implausibilities(with(softer)), PlausibilityRule::kSign));
  softer.stated = PhysicalQuantity::kNone;  // something, but not how much
  EXPECT_TRUE(implausibilities(with(softer)).empty());
}

TEST(Plausibility, ExcludesValuesAtABoundAndThoseThatRanAway) {
  PhysicalQuantity value = quantity(QuantityKind::kInertia, 5.0, 0.1);
  value.lowest = 0.1;
  value.highest = 5.0;
  EXPECT_TRUE(has(implausibilities(with(value)), PlausibilityRule::kBound));
  value.highest = 7.0;
  EXPECT_TRUE(implausibilities(with(value)).empty());
  for (const double factor : {1e4, 1e-4}) {
    value.start = 5.0 / factor;
    EXPECT_TRUE(has(implausibilities(with(value)), PlausibilityRule::kBound)) << factor;
  }
  // How far it ran is not printed: nothing holds it there.
  PhysicalQuantity far = quantity(QuantityKind::kInertia, 1.4e217, PhysicalQuantity::kNone);
  far.start = 0.866;
  const auto flaws = implausibilities(with(far));
  ASSERT_FALSE(flaws.empty());
  EXPECT_NE(flaws[0].words.find("ran beyond 1000 times what is stated, 0.866"), std::string::npos)
      << flaws[0].words;
  EXPECT_EQ(flaws[0].words.find("217"), std::string::npos) << flaws[0].words;
  value.start = 1.0;
  EXPECT_TRUE(implausibilities(with(value)).empty());
  // Without damping a model may do very well.
  PhysicalQuantity damping = quantity(QuantityKind::kDamping, 1e-6, 1e-7);
  damping.start = 1.0;
  EXPECT_TRUE(implausibilities(with(damping)).empty());
}

TEST(Plausibility, ExcludesSizesBeyondWhatTheChannelCarried) {
  FittedPhysics physics = with(quantity(QuantityKind::kFriction, 2e4, 3e3));
  physics.quantities[0].law = 0;
  physics.laws.push_back(swing("friction", [](double, double rate) { return rate; }));
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kSize));
  physics.quantities[0].standard_error = 1e4;  // it may be smaller
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kSize, false));
  physics.quantities[0].value = 8.0;
  physics.quantities[0].standard_error = 0.5;
  EXPECT_TRUE(implausibilities(physics).empty());
  physics.quantities[0].value = 2e4;
  physics.laws[0].carried = std::nan("");
  EXPECT_TRUE(implausibilities(physics).empty());
}

// A weight of 50 N m, of which a small swing shows 2.
TEST(Plausibility, AllowsAForceOfWhichTheMotionShowsASmallPart) {
  FittedPhysics physics = with(quantity(QuantityKind::kForce, 50.0, 0.1));
  physics.quantities[0].law = 0;
  physics.laws.push_back(swing(
      "gravity", [](double z, double) { return 50.0 * std::sin(z); }, 0.04));
  EXPECT_TRUE(implausibilities(physics).empty());
  physics.laws[0].carried = 0.5;
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kSize));
  physics.quantities[0].standard_error = 30.0;
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kSize, false));
}

TEST(Plausibility, ExcludesThresholdsThatTheMotionNeverReached) {
  for (const QuantityKind kind : {QuantityKind::kDeflection, QuantityKind::kRate}) {
    FittedPhysics physics = with(quantity(kind, 66.0, PhysicalQuantity::kNone));
    physics.quantities[0].law = 0;
    physics.laws.push_back(swing("law", [](double, double rate) { return rate; }));
    EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kThreshold)) << words_of(kind);
    physics.quantities[0].value = 2.5;
    physics.quantities[0].standard_error = 0.1;
    // A friction's curve is bent below its velocity; a gap that is not passed leaves no trace.
    EXPECT_EQ(has(implausibilities(physics), PlausibilityRule::kThreshold),
              kind == QuantityKind::kDeflection);
    physics.quantities[0].value = 4.0;
    EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kThreshold));
    physics.quantities[0].standard_error = 1.5;
    EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kThreshold, false));
    physics.quantities[0].value = 0.5;
    EXPECT_TRUE(implausibilities(physics).empty());
  }
}

TEST(Plausibility, ExcludesLawsThatCreateEnergy) {
  FittedPhysics physics;
  physics.laws = {swing("viscous", [](double, double rate) { return -0.1 * rate; })};
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kEnergy));
  physics.laws[0].fed_in = 10.0;  // a drop in it
  EXPECT_TRUE(implausibilities(physics).empty());
}

TEST(Plausibility, AllowsWhatOnlyGivesBackWhatItTookAndFrictionThatFallsWithSpeed) {
  FittedPhysics physics;
  physics.laws = {swing("spring", [](double z, double) { return 3.0 * z - z * z * z; })};
  EXPECT_TRUE(implausibilities(physics).empty());
  physics.laws = {swing("coulomb", [](double, double rate) { return std::tanh(rate / 0.01); }),
                  swing("viscous", [](double, double rate) { return -0.3 * rate; })};
  EXPECT_TRUE(implausibilities(physics).empty());
}

// A law with memory gives back in part of the swing what it took in another.
TEST(Plausibility, JudgesTheEnergyOfALawWithMemoryByItsSum) {
  const auto late = [](double lag) {
    LawTrace trace = swing("memory", [](double, double) { return 0.0; });
    trace.conservative.clear();
    trace.has_memory = true;
    for (std::size_t t = 0; t < trace.force.size(); ++t) {
      trace.force[t] = std::sin(2.0 * std::numbers::pi * static_cast<double>(t) / 400.0 + lag);
    }
    FittedPhysics physics;
    physics.laws = {trace};
    return implausibilities(physics);
  };
  EXPECT_TRUE(late(0.4).empty());
  EXPECT_TRUE(has(late(-0.4), PlausibilityRule::kEnergy));
}

// A spring and one with a clearance that takes more away than is there: no machine has it.
TEST(Plausibility, ExcludesSpringsThatPushAwayAtTheEnds) {
  const auto examined = [](double beyond, bool has_spring) {
    FittedPhysics physics;
    LawTrace spring = swing("stiffness at axis", [](double z, double) { return 3.4 * z; });
    LawTrace softer = swing("dead_zone at axis", [&](double z, double) {
      return beyond * std::copysign(std::max(std::abs(z) - 0.5, 0.0), z);
    });
    spring.place = softer.place = "axis";
    spring.conservative = spring.force;
    softer.conservative = softer.force;
    physics.laws = {spring, softer};
    if (has_spring) {
      PhysicalQuantity& own = physics.quantities.emplace_back();
      own.name = "stiffness";
      own.kind = QuantityKind::kStiffness;
      own.value = 10.0;
      own.standard_error = 0.1;
    }
    return has(implausibilities(physics), PlausibilityRule::kPair);
  };
  EXPECT_TRUE(examined(-7.9, false));
  EXPECT_FALSE(examined(-7.9, true));  // with the model's own it is a spring that softens
  EXPECT_FALSE(examined(-3.0, false));
  EXPECT_FALSE(examined(7.9, false));
}

TEST(Plausibility, ExcludesPairsOfLawsThatCancel) {
  FittedPhysics physics;
  const auto first = [](double z, double) { return 50.0 * z; };
  physics.laws = {swing("one", first), swing("other", [](double z, double) { return -49.0 * z; })};
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kPair));
  physics.laws[1] = swing("other", [](double z, double) { return -20.0 * z; });
  EXPECT_FALSE(has(implausibilities(physics), PlausibilityRule::kPair));
  physics.laws[1] = swing("other", [](double, double rate) { return 49.0 * rate; });
  EXPECT_FALSE(has(implausibilities(physics), PlausibilityRule::kPair));
}

TEST(Plausibility, ExcludesHomogeneousEquations) {
  FittedPhysics physics;
  for (const double value : {2.0, 30.0, 0.5}) {
    physics.quantities.push_back(quantity(QuantityKind::kOther, value, 0.01));
  }
  physics.unseen = {{Eigen::Vector3d(1.0, 0.99, 1.0)}};
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kHomogeneous));
  physics.unseen = {{Eigen::Vector3d(1.0, -0.5, 1.0)}};
  EXPECT_TRUE(implausibilities(physics).empty());
}

TEST(Plausibility, ExcludesPairsThatTheInputDoesNotTellApart) {
  FittedPhysics physics;
  for (const double value : {2.0, 30.0, 0.5}) {
    physics.quantities.push_back(quantity(QuantityKind::kOther, value, 0.4 * value));
  }
  physics.unseen = {{Eigen::Vector3d(1.0, 0.4, 0.0)}};
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kPoorInput));
  physics.unseen.clear();
  physics.correlation = Eigen::Matrix3d::Identity();
  physics.correlation(0, 1) = physics.correlation(1, 0) = 0.99999;
  EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kPoorInput));
  physics.quantities[0].standard_error = 0.01;  // known well all the same
  EXPECT_TRUE(implausibilities(physics).empty());
}

// k - m w^2 and d at one frequency say nothing of k and m; a second frequency does.
TEST(Plausibility, OneSineDoesNotTellInertiaFromStiffness) {
  const auto flaws_at = [](const std::vector<double>& frequencies) {
    const Eigen::Vector3d theta(2.0, 0.5, 300.0);
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (const double w : frequencies) {
      const Eigen::Vector3d real(-w * w, 0.0, 1.0), imaginary(0.0, w, 0.0);
      information += 1e4 * (real * real.transpose() + imaginary * imaginary.transpose());
    }
    FitReport report;
    const std::vector<std::string> names = {"load.inertia", "shaft.damping", "shaft.stiffness"};
    const std::vector<std::string> units = {"kg m^2", "N m s/rad", "N m/rad"};
    report.identifiability = examine_identifiability(information, theta, names);
    for (std::size_t p = 0; p < 3; ++p) {
      const double value = theta(static_cast<Eigen::Index>(p));
      report.parameters.push_back({names[p], units[p], value, value});
    }
    judge_plausibility(report);
    return report.implausible;
  };
  EXPECT_TRUE(has(flaws_at({7.0}), PlausibilityRule::kPoorInput));
  EXPECT_TRUE(flaws_at({7.0, 20.0}).empty());
}

// Second moments of points with mass: a body that exists.
PhysicalBody body_of_points(Random& random, int points) {
  PhysicalBody body;
  for (int k = 0; k < points; ++k) {
    const double mass = random.uniform(0.01, 2.0);
    const Eigen::Vector3d at(random.normal(), random.normal(), random.normal());
    body.mass += mass;
    body.first_moment += mass * at;
    body.inertia += mass * (at.squaredNorm() * Eigen::Matrix3d::Identity() - at * at.transpose());
  }
  return body;
}

TEST(Plausibility, KnowsBodiesThatExist) {
  Random random(3);
  for (int draw = 0; draw < 200; ++draw) {
    PhysicalBody body = body_of_points(random, 1 + draw % 6);
    EXPECT_TRUE(can_exist(body)) << draw;
    body.first_moment *= 100.0;  // farther out than its inertia allows
    EXPECT_FALSE(can_exist(body)) << draw;
  }
}

TEST(Plausibility, KnowsInertiasThatBreakTheTriangle) {
  Random random(4);
  for (int draw = 0; draw < 50; ++draw) {
    const double a = random.uniform(1.0, 2.0), b = random.uniform(1.0, 2.0);
    const Eigen::Matrix3d turned =
        Eigen::AngleAxisd(random.uniform(0.0, 3.0), Eigen::Vector3d(1.0, 2.0, -1.0).normalized())
            .toRotationMatrix();
    PhysicalBody body;
    body.name = "link 2";
    body.mass = 3.0;
    body.inertia = turned * Eigen::Vector3d(a, b, 0.98 * (a + b)).asDiagonal() * turned.transpose();
    EXPECT_TRUE(can_exist(body));
    body.inertia = turned * Eigen::Vector3d(a, b, 1.02 * (a + b)).asDiagonal() * turned.transpose();
    EXPECT_FALSE(can_exist(body));
    FittedPhysics physics;
    physics.bodies = {body};
    EXPECT_TRUE(has(implausibilities(physics), PlausibilityRule::kBody));
    physics.bodies[0].errors_from_possible = 2.0;  // it may be otherwise
    EXPECT_TRUE(implausibilities(physics).empty());
    body.mass = -1.0;
    EXPECT_FALSE(can_exist(body));
  }
}

TEST(Plausibility, TellsWhatAParameterIsByItsUnit) {
  const PlaceUnits turning{"N m", "rad", "kg m^2"}, straight{"N", "m", "kg"};
  for (const LawEntry& entry : law_catalogue()) {
    if (entry.use == LawUse::kSignal || entry.use == LawUse::kDelay) continue;
    for (const LawParameter& parameter : entry.parameters) {
      for (const PlaceUnits& units : {turning, straight}) {
        const QuantityKind kind = quantity_kind(parameter.name, unit_at(parameter.unit, units));
        if (parameter.unit == "F s/x") {
          EXPECT_EQ(kind, QuantityKind::kDamping) << entry.name;
        }
        if (parameter.unit == "F/x") {
          EXPECT_EQ(kind, QuantityKind::kStiffness) << entry.name;
        }
        if (parameter.unit == "F" && parameter.name.find("level") != std::string::npos) {
          EXPECT_EQ(kind, QuantityKind::kFriction) << entry.name;
        }
        if (parameter.unit == "F/x^3") {
          EXPECT_EQ(kind, QuantityKind::kOther) << entry.name;
        }
      }
    }
  }
}

TEST(Plausibility, ABaseParameterIsPositiveWhereItIsASumOfSuch) {
  const std::vector<std::string> relations = {"ZZ1R = ZZ1 + YY2 + 0.25 M2 + rotor_inertia_1",
                                              "XX2R = XX2 - YY2", "XZ2R = XZ2 + MX3",
                                              "ZZ3R = ZZ3 + MX4"};
  EXPECT_EQ(base_parameter_kind("ZZ1R", "kg m^2", relations), QuantityKind::kInertia);
  EXPECT_EQ(base_parameter_kind("M3", "kg", relations), QuantityKind::kMass);
  EXPECT_EQ(base_parameter_kind("friction.damping", "N m s/rad", relations),
            QuantityKind::kDamping);
  for (const char* name : {"XX2R", "XZ2R", "XY1", "MX2", "ZZ3R", "ZZ4R"}) {
    EXPECT_EQ(base_parameter_kind(name, "kg m^2", relations), QuantityKind::kOther) << name;
  }
}

}  // namespace
}  // namespace graybox
