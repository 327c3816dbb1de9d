// Plants with elements: closed forms, energy, delays to the fraction of a sample, and the local
// model against the non-linear robot.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "diagnosis/signals/multisine.hpp"
#include "diagnosis/simulation/closed_loop.hpp"
#include "diagnosis/simulation/plant.hpp"
#include "problems/base/error.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/robot_elements.hpp"
#include "tests/support/robot_test_support.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kMass = 2.0, kStep = 0.01;

// One mass on a line with a spring, its position and velocity measured.
std::string one_mass(double stiffness) {
  return "format: graybox-lumped/1\nsample_time: 0.01\nmotion: translation\nmasses: {body: 2}\n"
         "elements:\n  - name: spring\n    location: {kind: element, mass: body}\n"
         "    law: stiffness\n    parameters: {stiffness: {value: " +
         std::to_string(stiffness) +
         ", unit: N/m}}\n"
         "inputs:\n  - {name: force, mass: body}\noutputs:\n"
         "  - {name: position, mass: body, quantity: position}\n"
         "  - {name: speed, mass: body, quantity: velocity}\n";
}

std::string element(const std::string& name, const std::string& location,
                    const std::string& law_and_parameters) {
  return "  - name: " + name + "\n    location: {" + location +
         "}\n    law: " + law_and_parameters + "\n";
}

class ElementSimulation : public ::testing::Test {
 protected:
  std::unique_ptr<Plant> mass_plant(double stiffness, const std::string& elements) {
    testing::write_text(folder_.file("mass.yaml"), one_mass(stiffness));
    if (elements.empty()) return lumped_plant(load_lumped_model(folder_.file("mass.yaml")));
    testing::write_text(folder_.file("physics.yaml"),
                        "format: graybox-physics/1\nelements:\n" + elements);
    return lumped_plant(load_lumped_model(folder_.file("mass.yaml"), folder_.file("physics.yaml")),
                        kFine);
  }
  ExtendedRobot robot(const std::string& elements) {
    testing::write_text(folder_.file("physics.yaml"),
                        "format: graybox-physics/1\nelements:\n" + elements);
    return load_extended_robot(robot_test::robot_folder() / "irb6600_like.yaml",
                               folder_.file("physics.yaml"));
  }

  static constexpr IntegratorOptions kFine{1e-10, 1e-13};
  testing::TemporaryFolder folder_;
};

VectorXd force(double value) { return VectorXd::Constant(1, value); }

// The same equations, solved exactly and integrated.
TEST_F(ElementSimulation, IntegratesWhatItCanSolveExactly) {
  const auto exact = mass_plant(300.0, "");
  const auto integrated =
      mass_plant(200.0, element("more", "kind: element, mass: body",
                                "dead_zone\n    parameters: {clearance: {value: 0, unit: m}, "
                                "stiffness: {value: 100, unit: N/m}}"));
  for (int t = 0; t < 200; ++t) {
    const VectorXd push = force(std::sin(0.3 * t) + (t % 7 == 0 ? 2.0 : 0.0));
    exact->advance(push);
    integrated->advance(push);
    EXPECT_LT((exact->output() - integrated->output()).norm(), 1e-8) << t;
  }
}

// A mode hung on a mass is a second mass on a spring and damper.
TEST_F(ElementSimulation, AModeIsASecondMass) {
  const double inertia = 0.5, frequency = 3.0, ratio = 0.05;
  const double w = 2.0 * std::numbers::pi * frequency;
  const auto mode = mass_plant(
      40.0, element("mode", "kind: element, mass: body",
                    "mode\n    parameters: {inertia: {value: 0.5, unit: kg}, frequency: {value: 3, "
                    "unit: Hz}, damping_ratio: {value: 0.05, unit: 1}}"));
  LumpedModel two = load_lumped_model(folder_.file("mass.yaml"));
  const MatrixXd apart = (MatrixXd(2, 2) << 1, -1, -1, 1).finished();
  const MatrixXd first = (MatrixXd(2, 2) << 1, 0, 0, 0).finished();
  two.mass = VectorXd(Eigen::Vector2d(kMass, inertia)).asDiagonal();
  two.stiffness = 40.0 * first + inertia * w * w * apart;
  two.damping = 2.0 * ratio * inertia * w * apart;
  for (MatrixXd* matrix : {&two.position_output, &two.velocity_output}) {
    matrix->conservativeResizeLike(MatrixXd::Zero(2, 2));
  }
  two.input.conservativeResizeLike(MatrixXd::Zero(2, 1));
  const auto exact = lumped_plant(two);
  for (int t = 0; t < 300; ++t) {
    mode->advance(force(t < 5 ? 3.0 : 0.0));
    exact->advance(force(t < 5 ? 3.0 : 0.0));
    EXPECT_LT((mode->output() - exact->output()).norm(), 1e-8) << t;
  }
}

// Quadratic drag: 1/v grows evenly.
TEST_F(ElementSimulation, QuadraticDragSlowsDownHyperbolically) {
  const auto plant =
      mass_plant(0.0, element("drag", "kind: element, mass: body",
                              "quadratic_drag\n    parameters: {coefficient: {value: 0.8, unit: "
                              "N s^2/m^2}}"));
  plant->advance(force(500.0));
  const double start = plant->output()(1);
  for (int t = 1; t < 200; ++t) {
    plant->advance(force(0.0));
    EXPECT_NEAR(1.0 / plant->output()(1), 1.0 / start + 0.8 / kMass * kStep * t, 1e-7);
  }
}

// After a push an undamped hardening spring neither gains nor loses energy.
TEST_F(ElementSimulation, AHardeningSpringConservesEnergy) {
  const auto plant = mass_plant(10.0, element("hardening", "kind: element, mass: body",
                                              "cubic_spring\n    parameters: {stiffness: "
                                              "{value: 4000, unit: N/m^3}}"));
  const auto energy = [&] {
    const VectorXd y = plant->output();
    return 0.5 * kMass * y(1) * y(1) + 5.0 * y(0) * y(0) + 1000.0 * std::pow(y(0), 4);
  };
  plant->advance(force(100.0));
  const double start = energy();
  for (int t = 0; t < 1000; ++t) {
    plant->advance(force(0.0));
    EXPECT_NEAR(energy(), start, 1e-7 * start);
  }
}

TEST_F(ElementSimulation, DryFrictionSlowsDownEvenly) {
  const auto plant =
      mass_plant(0.0, element("friction", "kind: element, mass: body",
                              "coulomb\n    parameters: {level: {value: 3, unit: N}, "
                              "transition_velocity: {value: 1e-4, unit: m/s}}"));
  plant->advance(force(203.0));  // (203 - 3) N for 0.01 s: 1 m/s
  EXPECT_NEAR(plant->output()(1), 1.0, 1e-4);
  double speed = plant->output()(1);
  for (int t = 0; t < 60; ++t) {
    plant->advance(force(0.0));
    EXPECT_NEAR(plant->output()(1), speed - 3.0 / kMass * kStep, 1e-8);
    speed = plant->output()(1);
  }
  for (int t = 0; t < 30; ++t) plant->advance(force(0.0));
  EXPECT_NEAR(plant->output()(1), 0.0, 1e-6);  // it has stopped and stays
}

// A push of one sample arrives late by the delay, to the fraction of a sample; a late sensor shows
// the same.
TEST_F(ElementSimulation, DelaysToTheFractionOfASample) {
  const auto speed_at = [](double t) {  // of the undelayed mass, pushed by 200 N in 0 ... 0.01 s
    return 100.0 * std::clamp(t, 0.0, kStep);
  };
  for (const double delay : {0.004, 0.01, 0.0233, 0.03}) {
    const std::string time =
        "delay\n    parameters: {time: {value: " + std::to_string(delay) + ", unit: s}}";
    const auto late_actuator =
        mass_plant(0.0, element("late", "kind: actuator, input: force", time));
    const auto late_sensor = mass_plant(0.0, element("late", "kind: sensor, output: speed", time));
    for (int run = 0; run < 2; ++run) {
      late_actuator->restart();
      late_sensor->restart();
      for (int t = 1; t < 8; ++t) {
        for (Plant* plant : {late_actuator.get(), late_sensor.get()}) {
          plant->advance(force(t == 1 ? 200.0 : 0.0));
          EXPECT_NEAR(plant->output()(1), speed_at(kStep * t - delay), 1e-9) << delay << ' ' << t;
        }
      }
    }
  }
}

TEST_F(ElementSimulation, RefusesEndlessDelays) {
  EXPECT_THROW(
      (void)mass_plant(0.0, element("late", "kind: actuator, input: force",
                                    "delay\n    parameters: {time: {value: 1e300, unit: s}}")),
      InputError);
}

TEST_F(ElementSimulation, ALagAnswersAStepByAnExponential) {
  const std::string lag = "lag\n    parameters: {time_constant: {value: 0.05, unit: s}}";
  const auto plant = mass_plant(0.0, element("slow", "kind: actuator, input: force", lag));
  for (int t = 1; t < 50; ++t) {
    plant->advance(force(4.0));
    // The integral of 1 - exp(-t/T).
    const double time = kStep * t, expected = 2.0 * (time - 0.05 * (1.0 - std::exp(-time / 0.05)));
    EXPECT_NEAR(plant->output()(1), expected, 1e-8);
  }
}

TEST_F(ElementSimulation, SignalsPassTheirLawsInOrder) {
  const std::string gain = "gain\n    parameters: {error: {value: 1, unit: 1}}";
  const std::string limit = "saturation\n    parameters: {limit: {value: 3, unit: N}}";
  const auto first_gain = mass_plant(0.0, element("a", "kind: actuator, input: force", gain) +
                                              element("b", "kind: actuator, input: force", limit));
  const auto first_limit = mass_plant(0.0, element("a", "kind: actuator, input: force", limit) +
                                               element("b", "kind: actuator, input: force", gain));
  first_gain->advance(force(5.0));
  first_limit->advance(force(5.0));
  EXPECT_NEAR(first_gain->output()(1), 3.0 / kMass * kStep, 1e-10);
  EXPECT_NEAR(first_limit->output()(1), 6.0 / kMass * kStep, 1e-10);
}

// With gravity holding the gear on one flank and every other kind of element added, the local model
// about the new rest moves as the non-linear robot does, the more exactly the smaller the signal.
TEST_F(ElementSimulation, LocalAndNonLinearRobotAgreeForSmallSignals) {
  const ExtendedRobot extended = robot(
      element("play", "kind: element, joint: joint_2, axis: gearbox",
              "backlash\n    parameters: {half_gap: {value: 1e-5, unit: rad}, stiffness: {value: "
              "1e6, unit: N m/rad}}") +
      element("hardening", "kind: element, joint: joint_3, axis: gearbox",
              "cubic_spring\n    parameters: {stiffness: {value: 1e11, unit: N m/rad^3}}") +
      element("bristles", "kind: element, joint: joint_1, axis: motor",
              "lugre\n    parameters: {stiffness: {value: 50, unit: N m/rad}, bristle_damping: "
              "{value: 0.01, unit: N m s/rad}, damping: {value: 0.001, unit: N m s/rad}, level: "
              "{value: 0.5, unit: N m}, static_level: {value: 0.7, unit: N m}, "
              "stribeck_velocity: {value: 1, unit: rad/s}}") +
      element("mode", "kind: element, joint: joint_5, axis: arm",
              "mode\n    parameters: {inertia: {value: 2, unit: kg m^2}, frequency: {value: 30, "
              "unit: Hz}, damping_ratio: {value: 0.02, unit: 1}}") +
      element("gain", "kind: actuator, joint: joint_2",
              "gain\n    parameters: {error: {value: -0.1, unit: 1}}") +
      element("late", "kind: actuator, joint: joint_4",
              "delay\n    parameters: {time: {value: 0.0008, unit: s}}") +
      element("slow", "kind: sensor, joint: joint_6",
              "lag\n    parameters: {time_constant: {value: 0.001, unit: s}}"));
  const VectorXd position = robot_test::some_positions()[4];
  const auto local = local_robot_plant(extended.robot, extended.elements, position);
  const auto full = robot_plant(extended.robot, extended.elements, position);
  EXPECT_LT(local->output().norm() + full->output().norm(), 1e-15);
  double last = 1.0;
  for (const double rms : {0.2, 0.02}) {
    const MatrixXd reference = Multisine({.period = 300,
                                          .lines = {1, 5, 9, 15},
                                          .relative_amplitude = {},
                                          .inputs = 6,
                                          .rms = rms},
                                         4)
                                   .reference(1);
    const ClosedLoopOptions loop{.settling_periods = 0, .periods = 1};
    const double step = extended.robot.sample_time;
    const Recording linear =
        simulate_closed_loop(*local, extended.robot.controller, step, reference, loop);
    const Recording nonlinear =
        simulate_closed_loop(*full, extended.robot.controller, step, reference, loop);
    const double error = (linear.output - nonlinear.output).norm() / linear.output.norm();
    EXPECT_LT(error, 0.3 * last);
    last = error;
    if (rms > 0.1) continue;
    // The elements matter: without them the robot moves otherwise.
    const auto bare = local_robot_plant(extended.robot, {}, position);
    const Recording without =
        simulate_closed_loop(*bare, extended.robot.controller, step, reference, loop);
    EXPECT_GT((without.output - nonlinear.output).norm(), 0.05 * linear.output.norm());
  }
  EXPECT_LT(last, 1e-3);
}

// Without a controller the excitation is the input; white noise has the deviation asked for.
TEST_F(ElementSimulation, OpenLoopWithWhiteNoise) {
  const auto plant = mass_plant(300.0, "");
  const MatrixXd excitation = MatrixXd::Zero(1, 5000);
  const VectorXd deviation = VectorXd::LinSpaced(2, 0.1, 0.4);
  const Recording recording =
      simulate_closed_loop(*plant, std::nullopt, kStep, excitation,
                           {.settling_periods = 0, .periods = 1, .white_noise = deviation});
  EXPECT_EQ(recording.input, excitation);
  for (Eigen::Index k = 0; k < 2; ++k) {
    const double found = recording.output.row(k).norm() / std::sqrt(5000.0);
    EXPECT_NEAR(found / deviation(k), 1.0, 0.05);  // relative deviation 1 %; 5 sigma
  }
  EXPECT_THROW((void)simulate_closed_loop(*plant, std::nullopt, kStep, excitation,
                                          {.white_noise = VectorXd::Ones(1)}),
               InputError);
}

}  // namespace
}  // namespace graybox
