// Laws, places and files of elements: formulas, energy, reaction, units, and what is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/elements/element_dynamics.hpp"
#include "problems/laws/law_catalogue.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/robot_elements.hpp"
#include "problems/mechanisms/robot_rest.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/robot_test_support.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::VectorXd;

std::shared_ptr<const Law> law(const std::string& name, const std::vector<double>& parameters,
                               bool at_signal = false) {
  return find_law(name, at_signal)->make(parameters);
}

double static_force(const std::string& name, const std::vector<double>& parameters, double z,
                    double rate = 0.0, bool at_signal = false) {
  return law(name, parameters, at_signal)->force(z, rate, {});
}

std::vector<LawEntry> all_laws() {
  std::vector<LawEntry> all(law_catalogue().begin(), law_catalogue().end());
  all.insert(all.end(), supplementary_laws().begin(), supplementary_laws().end());
  return all;
}

TEST(LawCatalogue, AYieldingSpringGivesNoEnergy) {
  const LawEntry& spring = *find_law("bouc_wen", false);
  EXPECT_TRUE(keeps_order(spring, std::vector<double>{200.0, 0.05, 1.0, 0.5}));
  EXPECT_FALSE(keeps_order(spring, std::vector<double>{200.0, 0.05, 1.0, 0.4}));
  EXPECT_FALSE(keeps_order(spring, std::vector<double>{200.0, 0.05, 0.08, 0.5}));
}

TEST(LawCatalogue, FrictionAtRestIsNotBelowThatWhenSliding) {
  const LawEntry& stribeck = *find_law("stribeck", false);
  EXPECT_TRUE(keeps_order(stribeck, std::vector<double>{2.0, 2.5, 0.1, 0.01}));
  EXPECT_FALSE(keeps_order(stribeck, std::vector<double>{2.0, 1.5, 0.1, 0.01}));
  EXPECT_TRUE(keeps_order(*find_law("coulomb", false), std::vector<double>{2.0, 0.01}));
  for (const LawEntry& law : law_catalogue()) {
    for (const LawParameter& parameter : law.parameters) {
      if (parameter.at_least.empty()) continue;
      const bool is_number = std::strtod(parameter.at_least.c_str(), nullptr) > 0.0;
      EXPECT_EQ(std::ranges::count(law.parameters, parameter.at_least, &LawParameter::name),
                is_number ? 0 : 1)
          << law.name;
    }
  }
}

TEST(Laws, FollowTheirFormulas) {
  EXPECT_DOUBLE_EQ(static_force("stiffness", {3.0}, 0.5), 1.5);
  EXPECT_DOUBLE_EQ(static_force("cubic_spring", {-2.0}, -0.5), 0.25);
  EXPECT_DOUBLE_EQ(static_force("offset", {4.0}, 7.0), 4.0);
  // 3 kg at 0.2 m, hanging at -0.4 rad.
  const double weight = 3.0 * 9.81 * 0.2;
  EXPECT_NEAR(static_force("gravity", {weight * std::cos(0.4), weight * std::sin(0.4)}, 0.9),
              weight * std::sin(0.9 + 0.4), 1e-14);
  // A spring with backlash does not pull within the gap, and pulls from its edge on beyond it.
  for (const double z : {-0.3, -0.05, 0.0, 0.1, 0.4}) {
    const double spring = 10.0 * z + static_force("backlash", {0.1, 10.0}, z);
    const double expected = std::abs(z) < 0.1 ? 0.0 : 10.0 * (std::abs(z) - 0.1);
    EXPECT_NEAR(std::abs(spring), expected, 1e-14);
    EXPECT_NEAR(static_force("dead_zone", {0.1, 10.0}, z), spring, 1e-14);
  }
  EXPECT_NEAR(static_force("ripple", {2.0, 0.5, 0.0}, 0.125), 2.0, 1e-14);
  EXPECT_DOUBLE_EQ(static_force("viscous", {2.0}, 1.0, 3.0), 6.0);
  EXPECT_DOUBLE_EQ(static_force("quadratic_drag", {2.0}, 0.0, -3.0), -18.0);
  EXPECT_DOUBLE_EQ(static_force("deflection_damping", {2.0}, 0.5, -3.0), -1.5);
  EXPECT_NEAR(static_force("coulomb", {5.0, 1e-3}, 0.0, -1.0), -5.0, 1e-12);
  EXPECT_NEAR(static_force("asymmetric_coulomb", {5.0, 3.0, 1e-3}, 0.0, 1.0), 5.0, 1e-12);
  EXPECT_NEAR(static_force("asymmetric_coulomb", {5.0, 3.0, 1e-3}, 0.0, -1.0), -3.0, 1e-12);
  // Stribeck: the static level just beyond the transition, the Coulomb level when fast.
  EXPECT_NEAR(static_force("stribeck", {2.0, 3.0, 1.0, 1e-6}, 0.0, 1e-4), 3.0, 1e-7);
  EXPECT_NEAR(static_force("stribeck", {2.0, 3.0, 1.0, 1e-6}, 0.0, 10.0), 2.0, 1e-12);
  EXPECT_DOUBLE_EQ(static_force("gain", {0.1}, 20.0, 0.0, true), 2.0);
  EXPECT_DOUBLE_EQ(static_force("rectifier", {1.0}, -3.0, 0.0, true), 6.0);
  EXPECT_DOUBLE_EQ(static_force("rectifier", {1.0}, 3.0, 0.0, true), 0.0);
  EXPECT_DOUBLE_EQ(static_force("saturation", {5.0, 0.0}, -8.0, 0.0, true), 3.0);
  EXPECT_DOUBLE_EQ(static_force("curved_gain", {-0.25, 8.0}, -4.0, 0.0, true), 0.5);
  EXPECT_DOUBLE_EQ(static_force("dead_zone", {1.0}, 0.4, 0.0, true), -0.4);
}

// A step is followed at the limit, and a slow signal within the time constant.
TEST(Laws, ARateLimitHoldsTheRate) {
  const auto law = find_law("rate_limit", true)->make(std::vector<double>{5.0, 0.01});
  double x = 0.0, rate = 0.0;
  for (const auto& [signal, wanted] :
       {std::pair{1.0, 5.0}, {-1.0, -5.0}, {0.02, 2.0}, {0.0, 0.0}}) {
    law->state_rate(signal, 0.0, {&x, 1}, {&rate, 1});
    EXPECT_NEAR(rate, wanted, 1e-12) << signal;
    EXPECT_EQ(law->force(signal, 0.0, {&x, 1}), -signal);
  }
}

// Its force and its slope are continuous, and outside the corner it is a sharp one.
TEST(Laws, ASaturationsCornerIsRoundedAboutItsLimit) {
  const auto held = [](double s, double corner) {
    return s + static_force("saturation", {5.0, corner}, s, 0.0, true);
  };
  EXPECT_DOUBLE_EQ(held(4.0, 0.5), 4.0);
  EXPECT_DOUBLE_EQ(held(-5.6, 0.5), -5.0);
  EXPECT_DOUBLE_EQ(held(5.0, 0.5), 4.875);
  EXPECT_DOUBLE_EQ(held(-5.0, 0.5), -4.875);
  for (const double corner : {0.5, 4.0, 9.0}) {
    double last = 1.0;
    for (double s = 0.005; s < 15.0; s += 0.01) {
      const double slope = (held(s + 1e-6, corner) - held(s - 1e-6, corner)) / 2e-6;
      EXPECT_LE(slope, last + 1e-6) << s;
      EXPECT_GE(slope, last - 0.01 / std::min(corner, 5.0) - 1e-6) << s;
      last = slope;
    }
    EXPECT_NEAR(last, 0.0, 1e-9);
  }
}

// Slid evenly for long, bristles and hysteresis come to their levels.
TEST(Laws, ComeToTheirLevelsWhenSlidEvenly) {
  const auto slide = [](const std::string& name, const std::vector<double>& p, double rate) {
    const auto made = law(name, p);
    double state = 0.0, change = 0.0;
    for (int step = 0; step < 100000; ++step) {
      made->state_rate(0.0, rate, {&state, 1}, {&change, 1});
      state += 3e-4 * change;
    }
    return made->force(0.0, rate, {&state, 1});
  };
  for (const double rate : {0.1, -0.5, 3.0}) {
    const double sign = rate > 0.0 ? 1.0 : -1.0;
    EXPECT_NEAR(slide("dahl", {200.0, 10.0}, rate), 10.0 * sign, 1e-6);
    EXPECT_NEAR(slide("bouc_wen", {200.0, 0.05, 1.5, 0.6}, rate), 10.0 * sign, 1e-6);
    EXPECT_NEAR(slide("play_and_slip", {200.0, 50.0, 0.03, 10.0, 4.0}, rate), 10.0 * sign, 1e-6);
    EXPECT_NEAR(slide("asymmetric_play_and_slip", {200.0, 50.0, 0.03, 10.0, 7.0, 4.0}, rate),
                rate > 0.0 ? 10.0 : -7.0, 1e-6);
    const double level = 10.0 + 4.0 * std::exp(-rate * rate / 0.25);
    EXPECT_NEAR(slide("lugre", {200.0, 1.0, 0.7, 10.0, 14.0, 0.5}, rate), level * sign + 0.7 * rate,
                1e-6);
  }
}

// The torque of the balancer is the slope of its spring's energy.
TEST(Laws, TheBalancersTorqueIsTheSlopeOfItsEnergy) {
  const std::vector<double> p{2e4, 0.4, 0.9, 0.3, 0.2};
  const auto energy = [&](double z) {
    const double length =
        std::sqrt(p[2] * p[2] + p[3] * p[3] - 2.0 * p[2] * p[3] * std::cos(z - p[4]));
    return 0.5 * p[0] * (length - p[1]) * (length - p[1]);
  };
  for (const double z : {-2.0, -0.3, 0.2, 1.0, 2.5}) {
    const double slope = (energy(z + 1e-6) - energy(z - 1e-6)) / 2e-6;
    EXPECT_NEAR(static_force("balancer", p, z), slope, 1e-5 * p[0]);
  }
}

// The torque of the gas balancer is the slope of the work done on its gas, F_0 g/(n - 1) x^(1 - n)
// with x = 1 - s/g; long gas columns are springs of constant force.
TEST(Laws, TheGasBalancersTorqueIsTheSlopeOfItsEnergy) {
  const std::vector<double> p{3e4, 0.9, 1.3, 0.9, 0.3, 0.2};
  const auto stroke = [&](double z) {
    return std::sqrt(p[3] * p[3] + p[4] * p[4] - 2.0 * p[3] * p[4] * std::cos(z - p[5])) - 0.6;
  };
  const auto energy = [&](double z) {
    return p[0] * p[1] / (p[2] - 1.0) * std::pow(1.0 - stroke(z) / p[1], 1.0 - p[2]);
  };
  for (const double z : {-2.0, -0.3, 0.2, 1.0, 2.5}) {
    const double slope = (energy(z + 1e-6) - energy(z - 1e-6)) / 2e-6;
    EXPECT_NEAR(static_force("gas_balancer", p, z), slope, 1e-5 * p[0]);
    const double constant = (stroke(z + 1e-6) - stroke(z - 1e-6)) / 2e-6;
    EXPECT_NEAR(static_force("gas_balancer", {1.0, 1e9, 1.3, 0.9, 0.3, 0.2}, z), constant, 1e-6);
  }
  EXPECT_TRUE(std::isfinite(static_force("gas_balancer", {3e4, 0.1, 1.3, 0.9, 0.3, 0.2}, 3.0)));
  EXPECT_EQ(static_force("gas_balancer", {3e4, 0.1, 1.3, 0.3, 0.3, 0.2}, 0.2), 0.0);
}

// Work over the last of several closed cycles of motion, from fixed small Runge-Kutta steps.
double work_of_a_cycle(const Law& law, double amplitude, double frequency) {
  const double w = 2.0 * std::numbers::pi * frequency;
  constexpr int kCycles = 6, kSteps = 4000;
  const double h = 1.0 / (frequency * kSteps);
  const std::size_t n = law.state_count();
  std::vector<double> x(n), k1(n), k2(n), moved(n);
  law.rest(0.0, x);
  const auto z = [&](double t) { return amplitude * std::sin(w * t); };
  const auto rate = [&](double t) { return amplitude * w * std::cos(w * t); };
  double work = 0.0;
  for (int step = 0; step < kCycles * kSteps; ++step) {
    const double t = step * h;
    law.state_rate(z(t), rate(t), x, k1);
    for (std::size_t i = 0; i < n; ++i) moved[i] = x[i] + 0.5 * h * k1[i];
    law.state_rate(z(t + 0.5 * h), rate(t + 0.5 * h), moved, k2);
    if (step >= (kCycles - 1) * kSteps) {
      work += h * law.force(z(t + 0.5 * h), rate(t + 0.5 * h), moved) * rate(t + 0.5 * h);
    }
    for (std::size_t i = 0; i < n; ++i) x[i] += h * k2[i];
  }
  return work;
}

// Springs give back what they take, friction and hysteresis keep some, in every cycle.
TEST(Laws, SpringsConserveAndFrictionDissipates) {
  const double scale = 10.0 * 0.3;  // forces of some 10, amplitude 0.3
  for (const auto& [name, p] : std::vector<std::pair<std::string, std::vector<double>>>{
           {"stiffness", {30.0}},
           {"cubic_spring", {300.0}},
           {"backlash", {0.1, 30.0}},
           {"dead_zone", {0.1, 30.0}},
           {"ripple", {10.0, 0.2, 0.3}},
           {"balancer", {100.0, 0.2, 0.5, 0.3, 0.7}},
           {"gravity", {10.0, -4.0}},
           {"offset", {10.0}}}) {
    EXPECT_NEAR(work_of_a_cycle(*law(name, p), 0.3, 1.0), 0.0, 1e-6 * scale) << name;
  }
  for (const auto& [name, p] : std::vector<std::pair<std::string, std::vector<double>>>{
           {"viscous", {5.0}},
           {"coulomb", {10.0, 0.05}},
           {"asymmetric_coulomb", {10.0, 6.0, 0.05}},
           {"stribeck", {10.0, 14.0, 0.5, 0.05}},
           {"quadratic_drag", {3.0}},
           {"deflection_damping", {100.0}},
           {"dahl", {200.0, 10.0}},
           {"lugre", {200.0, 1.0, 0.5, 10.0, 14.0, 0.5}},
           {"bouc_wen", {200.0, 0.05, 1.5, 0.6}},
           {"play_and_slip", {200.0, 50.0, 0.03, 10.0, 4.0}},
           {"asymmetric_play_and_slip", {200.0, 50.0, 0.03, 10.0, 7.0, 4.0}},
           {"mode", {0.5, 1.5, 0.1}}}) {
    EXPECT_GT(work_of_a_cycle(*law(name, p), 0.3, 1.0), 0.05 * scale) << name;
  }
  // Slid over a width of 4 x 0.3, a friction of level 10 takes 10 x 1.2 in the limit of stiff
  // bristles.
  EXPECT_NEAR(work_of_a_cycle(*law("dahl", {4000.0, 10.0}), 0.3, 1.0), 12.0, 0.15);
  EXPECT_NEAR(work_of_a_cycle(*law("lugre", {4000.0, 0.0, 0.0, 10.0, 10.0, 1.0}), 0.3, 1.0), 12.0,
              0.15);
  EXPECT_NEAR(work_of_a_cycle(*law("bouc_wen", {4000.0, 0.0025, 2.0, 0.5}), 0.3, 1.0), 12.0, 0.15);
}

// Derivatives by deflection, rate, states and parameters against central differences, away from
// kinks.
TEST(Laws, DerivativesAreThoseOfTheFormulas) {
  for (const LawEntry& entry : all_laws()) {
    if (!entry.make) continue;
    std::vector<double> arguments{0.37, 0.61};  // z, z', states, parameters
    const std::size_t states =
        entry.make(std::vector<double>(entry.parameters.size(), 0.5))->state_count();
    for (std::size_t i = 0; i < states; ++i)
      arguments.push_back(0.13 + 0.1 * static_cast<double>(i));
    for (std::size_t i = 0; i < entry.parameters.size(); ++i) {
      arguments.push_back(0.45 + 0.07 * static_cast<double>(i));
    }
    // The force, then the rates of the states.
    const auto values = [&](const std::vector<double>& at) {
      const std::span<const double> all(at);
      const auto made = entry.make(all.subspan(2 + states));
      std::vector<double> result(1 + states);
      result[0] = made->force(at[0], at[1], all.subspan(2, states));
      made->state_rate(at[0], at[1], all.subspan(2, states), std::span(result).subspan(1));
      return result;
    };
    const std::span<const double> all(arguments);
    LawDerivatives found;
    entry.make(all.subspan(2 + states))
        ->differentiate(arguments[0], arguments[1], all.subspan(2, states), found);
    if (states == 1) {
      const StateRate alone = entry.make(all.subspan(3))
                                  ->state_rate_and_slope(arguments[0], arguments[1], arguments[2]);
      EXPECT_DOUBLE_EQ(alone.value, found.state_rate[0].value) << entry.name;
      EXPECT_DOUBLE_EQ(alone.by_state, found.state_rate[0].by_state[0]) << entry.name;
    }
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      std::vector<double> up = arguments, down = arguments;
      up[i] += 1e-6;
      down[i] -= 1e-6;
      for (std::size_t f = 0; f <= states; ++f) {
        const LawDerivative& derivative = f == 0 ? found.force : found.state_rate.at(f - 1);
        const double slope = i == 0           ? derivative.by_deflection
                             : i == 1         ? derivative.by_rate
                             : i < 2 + states ? derivative.by_state.at(i - 2)
                                              : derivative.by_parameter.at(i - 2 - states);
        EXPECT_NEAR(slope, (values(up)[f] - values(down)[f]) / 2e-6, 1e-7 * (1.0 + std::abs(slope)))
            << entry.name << " " << i << " " << f;
        EXPECT_DOUBLE_EQ(derivative.value, values(arguments)[f]) << entry.name;
      }
    }
  }
}

TEST(Laws, EveryEntryIsComplete) {
  for (const LawEntry& entry : all_laws()) {
    EXPECT_FALSE(entry.description.empty()) << entry.name;
    EXPECT_FALSE(entry.parameters.empty()) << entry.name;
    const bool has_law = entry.use == LawUse::kForce || entry.use == LawUse::kSignal;
    EXPECT_EQ(has_law, static_cast<bool>(entry.make)) << entry.name;
    if (!has_law) continue;
    // At rest the states do not move.
    const auto made = entry.make(std::vector<double>(entry.parameters.size(), 0.5));
    std::vector<double> states(made->state_count()), rates(made->state_count(), 0.0);
    made->rest(0.3, states);
    made->state_rate(0.3, 0.0, states, rates);
    for (const double rate : rates) EXPECT_EQ(rate, 0.0) << entry.name;
  }
}

// LawParameter::is_linear: f(p + s) = f(p) + f(s) where p and s differ in the marked parameters
// alone, and every force without states has one.
TEST(Laws, ForcesAreLinearInTheParametersMarkedSo) {
  for (const LawEntry& entry : all_laws()) {
    if (entry.use != LawUse::kForce) continue;
    std::vector<double> one, other, sum;
    for (std::size_t k = 0; k < entry.parameters.size(); ++k) {
      const bool is_linear = entry.parameters[k].is_linear;
      const double value = 0.3 + 0.1 * static_cast<double>(k);
      one.push_back(value);
      other.push_back(is_linear ? 0.7 * value * value : value);
      sum.push_back(is_linear ? one.back() + other.back() : value);
    }
    const auto first = entry.make(one);
    if (first->state_count() > 0) continue;
    EXPECT_TRUE(std::ranges::any_of(entry.parameters, &LawParameter::is_linear)) << entry.name;
    for (const double z : {-1.3, 0.4, 2.0}) {
      for (const double rate : {-0.8, 0.05, 1.7}) {
        EXPECT_NEAR(entry.make(sum)->force(z, rate, {}),
                    first->force(z, rate, {}) + entry.make(other)->force(z, rate, {}), 1e-12)
            << entry.name;
      }
    }
  }
}

const std::string kDrive = R"(format: graybox-lumped/1
sample_time: 0.001
motion: rotation
masses: {motor: 0.002, load: 0.03}
elements:
  - name: shaft
    location: {kind: element, between: [motor, load]}
    law: stiffness
    parameters: {stiffness: {value: 45, unit: N m/rad}}
inputs:
  - {name: torque, mass: motor}
outputs:
  - {name: speed, mass: load, quantity: velocity}
)";

std::string physics(const std::string& location, const std::string& law_and_parameters) {
  return "format: graybox-physics/1\nelements:\n  - name: extra\n    location: {" + location +
         "}\n    law: " + law_and_parameters + "\n";
}

class ElementFiles : public ::testing::Test {
 protected:
  ElementFiles() {
    testing::write_text(folder_.file("drive.yaml"), kDrive);
    for (const char* name : {"irb6600_like.yaml", "irb6600_like.urdf"}) {
      std::filesystem::copy_file(robot_test::robot_folder() / name, folder_.file(name));
    }
  }

  LumpedModel drive(const std::string& text) {
    testing::write_text(folder_.file("physics.yaml"), text);
    return load_lumped_model(folder_.file("drive.yaml"), folder_.file("physics.yaml"));
  }
  ExtendedRobot robot(const std::string& text) {
    testing::write_text(folder_.file("physics.yaml"), text);
    return load_extended_robot(folder_.file("irb6600_like.yaml"), folder_.file("physics.yaml"));
  }

  testing::TemporaryFolder folder_;
};

// Forces between masses add up to nothing: the total momentum feels the inputs alone.
TEST_F(ElementFiles, ElementsBetweenMassesKeepTheTotalMomentum) {
  for (const LawEntry& entry : all_laws()) {
    if (entry.use != LawUse::kForce) continue;
    std::string parameters = entry.name + "\n    parameters:\n";
    for (const LawParameter& parameter : entry.parameters) {
      parameters += "      " + parameter.name + ": {value: 0.5, unit: " +
                    unit_at(parameter.unit, {"N m", "rad", "kg m^2", "(N m)"}) + "}\n";
    }
    std::string location = "kind: element, between: [motor, load]";
    if (entry.name == "load_dependent_friction" || entry.name == "driven_viscous") {
      location += ", driven_by: {input: torque}";
    }
    const LumpedModel model = drive(physics(location, parameters));
    const VectorXd ones = VectorXd::Ones(2);
    EXPECT_LT((ones.transpose() * model.stiffness).norm(), 1e-14) << entry.name;
    EXPECT_LT((ones.transpose() * model.damping).norm(), 1e-14) << entry.name;
    const ElementDynamics dynamics(model.elements, 1, 1);
    const VectorXd q = VectorXd::LinSpaced(2, 1.1, 0.2), velocity = VectorXd::LinSpaced(2, -1, 2);
    VectorXd states = VectorXd::Constant(dynamics.state_count(), 0.1), rates = states;
    VectorXd force = VectorXd::Zero(2);
    dynamics.add_force(q, velocity, states, force, rates);
    EXPECT_NEAR(force.sum(), 0.0, 1e-14) << entry.name;
    if (entry.name != "stiffness" && entry.name != "viscous") {
      EXPECT_GT(force.norm(), 1e-3) << entry.name;
    }
  }
}

TEST_F(ElementFiles, LinearElementsEnterTheMatrices) {
  const LumpedModel inertia =
      drive(physics("kind: element, deflection: {motor: 1, load: -5}",
                    "inertia\n    parameters: {inertia: {value: 0.001, unit: kg m^2}}"));
  EXPECT_NEAR(inertia.mass(1, 1), 0.03 + 25 * 0.001, 1e-15);
  EXPECT_NEAR(inertia.mass(0, 1), -5 * 0.001, 1e-15);
  const LumpedModel cross =
      drive(physics("kind: element, mass: load, driven_by: {mass: motor}",
                    "viscous\n    parameters: {damping: {value: 2, unit: N m s/rad}}"));
  EXPECT_EQ(cross.damping(1, 0), 2.0);
  EXPECT_EQ(cross.damping(0, 1), 0.0);
}

// Payload and inertia of the robot, against the kinetic energy they add.
TEST_F(ElementFiles, PayloadAndInertiaAreBuiltIntoTheRobot) {
  const RobotModel base = robot_test::paper_robot();
  const ExtendedRobot loaded = robot(
      physics("kind: element, axis: flange",
              "payload\n    parameters: {mass: {value: 50, unit: kg}, x: {value: 0.3, unit: m}, "
              "y: {value: 0.1, unit: m}, z: {value: -0.2, unit: m}}"));
  RigidChainEvaluator before(base.chain), after(loaded.robot.chain);
  const VectorXd q = VectorXd::LinSpaced(12, -0.5, 0.6), velocity = VectorXd::LinSpaced(12, 1, -1);
  const auto point = [&](const VectorXd& at) {
    // The mass centre of the last body of a chain whose last body is the payload alone.
    std::vector<ChainRotation> rotations = base.chain.rotations();
    rotations.back().body.centre_of_mass = {0.3, 0.1, -0.2};
    RigidChainEvaluator places(RigidChain(rotations, base.chain.gravity()));
    return places.body_places(at).centres_of_mass.back();
  };
  const Eigen::Vector3d speed = (point(q + 1e-6 * velocity) - point(q - 1e-6 * velocity)) / 2e-6;
  const double energy = velocity.dot((after.mass_matrix(q) - before.mass_matrix(q)) * velocity);
  EXPECT_NEAR(energy, 50.0 * speed.squaredNorm(), 1e-6 * energy);
  EXPECT_NEAR(after.potential_energy(q) - before.potential_energy(q), 50.0 * 9.81 * point(q).z(),
              1e-6);

  const ExtendedRobot heavier =
      robot(physics("kind: element, joint: joint_2, axis: motor",
                    "inertia\n    parameters: {inertia: {value: 0.001, unit: kg m^2}}"));
  EXPECT_NEAR(heavier.robot.motor_inertia(1), base.motor_inertia(1) + 0.001, 1e-15);
  const ExtendedRobot turned =
      robot(physics("kind: element, joint: joint_4, axis: arm",
                    "inertia\n    parameters: {inertia: {value: 3, unit: kg m^2}}"));
  RigidChainEvaluator with(turned.robot.chain);
  EXPECT_NEAR(with.mass_matrix(q)(9, 9) - before.mass_matrix(q)(9, 9), 3.0, 1e-9);
}

// No values of a law's parameters make what other values make as well, but for parameters that are
// said to set the scale of others: a fit that moves both finds no end.
TEST(LawCatalogue, OnlyDeclaredParametersSetTheScaleOfOthers) {
  for (const LawEntry& entry : all_laws()) {
    if (!entry.make || !entry.definition.empty()) continue;  // other tests add laws of their own
    std::vector<double> values;
    for (std::size_t p = 0; p < entry.parameters.size(); ++p) {
      values.push_back(1.0 - 0.13 * static_cast<double>(p));
    }
    const auto shared = entry.make(values);
    if (shared->state_count() > 0) continue;
    const auto count = static_cast<Eigen::Index>(values.size());
    Eigen::MatrixXd slopes(400, count);
    LawDerivatives derivatives;
    for (Eigen::Index i = 0; i < slopes.rows(); ++i) {
      const double t = 0.1 * static_cast<double>(i);
      shared->differentiate(1.5 * std::sin(t), 2.0 * std::sin(1.7 * t + 0.4), {}, derivatives);
      for (Eigen::Index p = 0; p < count; ++p) {
        slopes(i, p) = derivatives.force.by_parameter[static_cast<std::size_t>(p)];
      }
    }
    std::vector<Eigen::Index> others;
    for (Eigen::Index p = 0; p < count; ++p) {
      slopes.col(p).normalize();
      if (!entry.parameters[static_cast<std::size_t>(p)].sets_scale) others.push_back(p);
    }
    const auto rank = [](const Eigen::MatrixXd& matrix) {
      const Eigen::VectorXd singular = matrix.jacobiSvd().singularValues();
      return static_cast<std::size_t>((singular.array() > 1e-7 * singular(0)).count());
    };
    EXPECT_EQ(rank(slopes(Eigen::all, others)), others.size()) << entry.name;
    EXPECT_EQ(rank(slopes), others.size()) << entry.name;
  }
}

// Whatever the elements, the arm rests where springs, gravity and elements balance.
TEST_F(ElementFiles, TheRobotRestsWithItsElements) {
  const RobotModel base = robot_test::paper_robot();
  for (const auto& [location, law_text] : std::vector<std::pair<std::string, std::string>>{
           {"kind: element, joint: joint_2, axis: gearbox",
            "backlash\n    parameters: {half_gap: {value: 1e-3, unit: rad}, "
            "stiffness: {value: 3.07e6, unit: N m/rad}}"},
           {"kind: element, joint: joint_3, axis: gearbox",
            "cubic_spring\n    parameters: {stiffness: {value: 1e13, unit: N m/rad^3}}"},
           {"kind: element, joint: joint_2, axis: arm",
            "balancer\n    parameters: {stiffness: {value: 1e5, unit: N/m}, free_length: {value: "
            "0.4, unit: m}, anchor_distance: {value: 0.8, unit: m}, lever_length: {value: 0.3, "
            "unit: m}, anchor_angle: {value: 2.5, unit: rad}}"}}) {
    const ExtendedRobot extended = robot(physics(location, law_text));
    const ElementDynamics elements(extended.elements, 6, 6);
    const VectorXd angles = robot_test::some_positions()[4];
    const RobotRest rest = robot_rest(extended.robot, elements, angles);
    EXPECT_EQ(rest.coordinates.tail(6), angles);
    RigidChainEvaluator evaluator(base.chain);
    VectorXd force = VectorXd::Zero(18), none(0);
    elements.add_force(rest.coordinates, VectorXd::Zero(18), none, force, none);
    const Eigen::Index gearboxes[] = {2, 5, 8, 9, 10, 11};
    VectorXd deflection = rest.coordinates.head(12);
    for (Eigen::Index j = 0; j < 6; ++j) deflection(gearboxes[j]) -= angles(j);
    VectorXd torque(12);
    for (Eigen::Index i = 0; i < 12; ++i) {
      torque(i) = base.springs[static_cast<std::size_t>(i)].stiffness * deflection(i);
    }
    const VectorXd left_over =
        torque + evaluator.gravity_torque(rest.coordinates.head(12)) - force.head(12);
    EXPECT_LT(left_over.norm(), 1e-5) << law_text;
    for (Eigen::Index j = 0; j < 6; ++j) {
      EXPECT_NEAR(
          base.transmission(j, j) * rest.holding_torque(j) + torque(gearboxes[j]) + force(12 + j),
          0.0, 1e-5);
    }
  }
}

TEST_F(ElementFiles, ActuatorsHoldTheRobotThroughTheirLaws) {
  const auto command = [&](const std::string& text, double torque) {
    const ExtendedRobot extended = robot(physics("kind: actuator, joint: joint_1", text));
    return ElementDynamics(extended.elements, 6, 6).command_for(torque * VectorXd::Unit(6, 0))(0);
  };
  EXPECT_NEAR(command("gain\n    parameters: {error: {value: 0.25, unit: 1}}", 5.0), 4.0, 1e-12);
  EXPECT_NEAR(command("offset\n    parameters: {value: {value: 2, unit: N m}}", 5.0), 3.0, 1e-12);
  EXPECT_NEAR(command("dead_zone\n    parameters: {half_width: {value: 1, unit: N m}}", -5.0), -6.0,
              1e-12);
  EXPECT_NEAR(command("lag\n    parameters: {time_constant: {value: 1, unit: s}}", 5.0), 5.0,
              1e-12);
  const std::string saturation = "saturation\n    parameters: {limit: {value: 2, unit: N m}}";
  EXPECT_NEAR(command(saturation, 1.5), 1.5, 1e-12);
  testing::expect_refused([&] { (void)command(saturation, 3.0); }, "can't give");
  // A corner that is left out is sharp, and stays so.
  const ExtendedRobot sharp = robot(physics("kind: actuator, joint: joint_1", saturation));
  EXPECT_EQ(sharp.elements.front().parameters, (std::vector<double>{2.0, 0.0}));
  EXPECT_EQ(sharp.elements.front().fixed, (std::vector<bool>{false, true}));
  const ExtendedRobot rounded =
      robot(physics("kind: actuator, joint: joint_1",
                    "saturation\n    parameters: {limit: {value: 2, unit: N m}, "
                    "corner: {value: 0.1, unit: N m}}"));
  EXPECT_EQ(rounded.elements.front().parameters, (std::vector<double>{2.0, 0.1}));
}

TEST_F(ElementFiles, RefusesWhatIsWrongInOneLine) {
  const std::string gearbox = "kind: element, joint: joint_2, axis: gearbox";
  const std::string spring = "stiffness\n    parameters: {stiffness: {value: 1, unit: N m/rad}}";
  struct Mistake {
    std::string location, law, message;
  };
  for (const auto& [location, law_text, message] : std::vector<Mistake>{
           {"kind: spring, joint: joint_2, axis: gearbox", spring, "location.kind"},
           {"kind: element, joint: joint_7, axis: gearbox", spring, "no joint 'joint_7'"},
           {"kind: element, joint: joint_4, axis: bearing_x", spring, "no axis 'bearing_x'"},
           {"kind: element, joint: joint_2", spring, "axis"},
           {"kind: actuator, joint: joint_2, axis: motor", spring, "axis"},
           {gearbox, "springy\n    parameters: {}", "no law 'springy'"},
           {gearbox, "lag\n    parameters: {time_constant: {value: 1, unit: s}}", "no law 'lag'"},
           {"kind: sensor, joint: joint_2", spring, "no law 'stiffness'"},
           {gearbox, "stiffness\n    parameters: {stiffness: 3}", "unit: N m/rad"},
           {gearbox, "stiffness\n    parameters: {stiffness: {value: 1, unit: Nm/rad}}",
            "must be 'N m/rad'"},
           {gearbox, "stiffness\n    parameters: {}", "'stiffness' is missing"},
           {gearbox,
            "stiffness\n    parameters: {stiffness: {value: 1, unit: N m/rad}, k: {value: 1}}",
            "no parameter of the law"},
           {gearbox,
            "quadratic_drag\n    parameters: {coefficient: {value: -1, unit: N m s^2/rad^2}}",
            "must not be negative"},
           {gearbox, "stiffness\n    parameters: {stiffness: {value: .nan, unit: N m/rad}}",
            "finite"},
           {gearbox, "inertia\n    parameters: {inertia: {value: 1, unit: kg m^2}}",
            "inertia can't be put"},
           {"kind: element, axis: flange", spring, "payloads alone"},
           {"kind: element, joint: joint_2, axis: motor",
            "inertia\n    parameters: {inertia: {value: -1, unit: kg m^2}}", "negative inertia"}}) {
    testing::expect_refused([&] { (void)robot(physics(location, law_text)); }, message);
  }
  testing::expect_refused([&] { (void)drive(physics("kind: element, mass: wheel", spring)); },
                          "no mass 'wheel'");
  testing::expect_refused(
      [&] { (void)drive(physics("kind: element, between: [motor, motor]", spring)); },
      "two masses");
  testing::expect_refused([&] { (void)drive(physics("kind: element", spring)); }, "needs one of");
  testing::expect_refused([&] { (void)drive("format: graybox-physics/2\nelements: []\n"); },
                          "format");
  const std::string twice = physics("kind: element, mass: load", spring);
  testing::expect_refused([&] { (void)drive(twice + twice.substr(twice.find("  - name"))); },
                          "name of an earlier element");
}

// Laws of actuators and sensors that a recorded input drives, and inputs that do nothing else.
TEST_F(ElementFiles, ASignalMayDriveALaw) {
  const std::string at_speed = "kind: sensor, output: speed, driven_by: {input: torque}";
  const auto gain = [](const std::string& unit) {
    return "feedthrough\n    parameters: {gain: {value: 0.5, unit: " + unit + "}}\n";
  };
  const LumpedModel model = drive(physics(at_speed, gain("rad/s/(N m)")));
  EXPECT_EQ(model.parts.back().location.driver, 0);
  EXPECT_FALSE(model.is_driven_by_forces_alone());
  testing::expect_refused([&] { (void)drive(physics(at_speed, gain("rad/s/N m"))); },
                          "must be 'rad/s/(N m)'");
  testing::expect_refused([&] { (void)drive(physics("kind: sensor, output: speed", gain("1"))); },
                          "needs a location with driven_by");
  testing::expect_refused(
      [&] {
        (void)drive(
            physics(at_speed, "offset\n    parameters: {value: {value: 1, unit: rad/s}}\n"));
      },
      "'offset' is of the signal itself");
  testing::expect_refused(
      [&] {
        (void)drive(physics("kind: actuator, input: torque, driven_by: {input: torque}",
                            gain("N m/(N m)")));
      },
      "is the signal itself");
  testing::expect_refused(
      [&] {
        (void)drive(physics("kind: sensor, output: speed, driven_by: {mass: motor}", gain("1")));
      },
      "driven_by");

  const std::string at_motor = "kind: element, mass: motor, driven_by: {input: torque}";
  const auto friction = [](const std::string& unit) {
    return "load_dependent_friction\n    parameters:\n      level: {value: 0.1, unit: N m}\n      "
           "coefficient: "
           "{value: 0.2, unit: " +
           unit + "}\n      transition_velocity: {value: 1e-3, unit: rad/s}\n";
  };
  const LumpedModel loaded = drive(physics(at_motor, friction("N m/(N m)")));
  EXPECT_EQ(loaded.parts.back().location.driver, 0);
  EXPECT_DOUBLE_EQ(loaded.parts.back().law->force(-3.0, 1.0, {}), 0.1 + 0.2 * 3.0);
  testing::expect_refused([&] { (void)drive(physics(at_motor, friction("N m/rad"))); },
                          "must be 'N m/(N m)'");
  testing::expect_refused(
      [&] { (void)drive(physics("kind: element, mass: motor", friction("1"))); },
      "needs a location with driven_by");
  testing::expect_refused(
      [&] {
        (void)drive(
            physics(at_motor, "stiffness\n    parameters: {stiffness: {value: 1, unit: N m/rad}}"));
      },
      "is of a deflection");

  const auto with_input = [&](const std::string& input) {
    std::string text = kDrive;
    text.replace(text.find("  - {name: torque"), 0, "  - {name: more, " + input + "}\n");
    testing::write_text(folder_.file("drive.yaml"), text);
    return load_lumped_model(folder_.file("drive.yaml"));
  };
  EXPECT_EQ(with_input("quantity: signal, unit: A").input_units.front(), "A");
  testing::expect_refused([&] { (void)with_input("quantity: signal"); }, "unit");
  testing::expect_refused([&] { (void)with_input("quantity: signal, unit: mA"); },
                          "converted to, A");
  testing::expect_refused([&] { (void)with_input("quantity: signal, unit: furlong"); },
                          "is none of");
  testing::expect_refused([&] { (void)with_input("quantity: signal, unit: A, mass: motor"); },
                          "mass");
  testing::expect_refused([&] { (void)with_input("mass: motor, unit: N m"); }, "unit");
}

// A law would have to change an imposed motion and its rates alike.
TEST_F(ElementFiles, ImposedMotionsTakeNoLaws) {
  std::string text = kDrive;
  text.replace(text.find("mass: motor}"), 12, "mass: motor, quantity: position}");
  testing::write_text(folder_.file("drive.yaml"), text);
  testing::expect_refused(
      [&] {
        (void)drive(physics("kind: actuator, input: torque",
                            "delay\n    parameters: {time: {value: 0.01, unit: s}}\n"));
      },
      "imposes a motion, which takes no laws");
}

TEST_F(ElementFiles, BalancersNeedARotation) {
  std::string text = kDrive;
  text.replace(text.find("motion: rotation"), 16, "motion: translation");
  text.replace(text.find("N m/rad"), 7, "N/m");
  testing::write_text(folder_.file("drive.yaml"), text);
  for (const char* name : {"balancer", "gas_balancer"}) {
    testing::expect_refused(
        [&] {
          (void)drive(
              physics("kind: element, mass: load", std::string(name) + "\n    parameters: {}\n"));
        },
        "needs a rotation");
  }
}

// What is linear and beside the robot's own parts is added to them.
TEST_F(ElementFiles, LinearElementsJoinTheRobotsOwnParts) {
  const std::string robot_file = testing::read_text(folder_.file("irb6600_like.yaml"));
  const auto extended_by = [&](const std::string& location, const std::string& law) {
    testing::write_text(
        folder_.file("extended.yaml"),
        robot_file +
            physics(location, law).substr(std::string("format: graybox-physics/1\n").size()));
    return folder_.file("extended.yaml");
  };
  const RobotModel own = load_robot_model(folder_.file("irb6600_like.yaml"));
  const VectorXd position = VectorXd::Constant(6, 0.3);
  const auto local = [&](const RobotModel& robot) {
    return LocalModelBuilder(robot).build(position);
  };
  const Eigen::Index gearbox = own.gearbox_rotations()[1];
  {
    const std::string file =
        extended_by("kind: element, joint: joint_2, axis: gearbox",
                    "stiffness\n    parameters: {stiffness: {value: 1e5, unit: N m/rad}}");
    EXPECT_EQ(load_extended_robot(file).elements.size(), 1U);
    testing::expect_refused([&] { (void)load_robot_model(file); }, "elements");
    VectorXd b = VectorXd::Unit(18, gearbox);
    b(13) = -1.0;
    const LocalModel stiff = LocalModelBuilder(load_linear_robot(file).robot)
                                 .build_at(local(own).position.head(12), position);
    EXPECT_LT((stiff.stiffness - local(own).stiffness - 1e5 * b * b.transpose()).norm(), 1e-6);
  }
  {
    const auto [damped, left_out] = load_linear_robot(
        extended_by("kind: element, joint: joint_3, axis: motor",
                    "viscous\n    parameters: {damping: {value: 0.25, unit: N m s/rad}}"));
    EXPECT_TRUE(left_out.empty());
    const VectorXd turned = own.transmission.row(2).transpose();
    Eigen::MatrixXd expected = local(own).damping;
    expected.bottomRightCorner(6, 6) += 0.25 * turned * turned.transpose();
    EXPECT_LT((local(damped).damping - expected).norm(), 1e-9 * expected.norm());
  }
  const auto [loaded, left_out] = load_linear_robot(extended_by(
      "kind: element, axis: flange",
      "payload\n    parameters: {mass: {value: 50, unit: kg}, x: {value: 0.1, unit: m}, "
      "y: {value: 0, unit: m}, z: {value: 0.2, unit: m}}"));
  EXPECT_GT((local(loaded).mass - local(own).mass).norm(), 1.0);
  EXPECT_TRUE(left_out.empty());
}

TEST_F(ElementFiles, LinearModelsNameTheElementsThatTheyLeaveOut) {
  const std::string robot_file = testing::read_text(folder_.file("irb6600_like.yaml"));
  const auto load_with = [&](const std::string& location, const std::string& law) {
    testing::write_text(
        folder_.file("extended.yaml"),
        robot_file +
            physics(location, law).substr(std::string("format: graybox-physics/1\n").size()));
    return load_linear_robot(folder_.file("extended.yaml"));
  };
  const LocalModel own = LocalModelBuilder(load_robot_model(folder_.file("irb6600_like.yaml")))
                             .build(VectorXd::Constant(6, 0.3));
  for (const auto& [location, law, name] :
       {std::tuple{"kind: element, joint: joint_2, axis: motor",
                   "coulomb\n    parameters: {level: {value: 1, unit: N m}, transition_velocity: "
                   "{value: 0.01, unit: rad/s}}",
                   "(coulomb at joint_2.motor)"},
        {"kind: element, joint: joint_2, axis: arm",
         "viscous\n    parameters: {damping: {value: 1, unit: N m s/rad}}",
         "(viscous at joint_2.arm)"}}) {
    const LinearRobot linear = load_with(location, law);
    ASSERT_EQ(linear.left_out.size(), 1U);
    EXPECT_NE(linear.left_out.front().find(name), std::string::npos) << linear.left_out.front();
    const LocalModel same = LocalModelBuilder(linear.robot).build(VectorXd::Constant(6, 0.3));
    EXPECT_EQ(same.mass, own.mass);
    EXPECT_EQ(same.damping, own.damping);
    EXPECT_EQ(same.stiffness, own.stiffness);
  }
  testing::expect_refused(
      [&] {
        (void)load_with("kind: element, joint: joint_2, axis: gearbox",
                        "stiffness\n    parameters: {stiffness: {value: -1e12, unit: N m/rad}}");
      },
      "must be positive");
  testing::expect_refused(
      [&] {
        (void)load_with("kind: element, joint: joint_2, axis: motor",
                        "viscous\n    parameters: {damping: {value: -100, unit: N m s/rad}}");
      },
      "must not be negative");
}

}  // namespace
}  // namespace graybox
