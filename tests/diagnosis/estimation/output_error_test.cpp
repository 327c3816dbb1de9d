// Output-error simulation and fit of lumped models: inputs between samples, trajectories and their
// derivatives, and estimates against known truth.
#include <cvodes/cvodes.h>
#include <gtest/gtest.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "diagnosis/output_error/linear_start.hpp"
#include "diagnosis/output_error/output_delay.hpp"
#include "diagnosis/output_error/output_error_fit.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::VectorXd;

LumpedModel model_of(const std::string& text) {
  const testing::TemporaryFolder folder;
  testing::write_text(folder.file("model.yaml"), text);
  return load_lumped_model(folder.file("model.yaml"));
}

std::string element(const std::string& name, const std::string& location, const std::string& law,
                    const std::string& parameters) {
  return "  - name: " + name + "\n    location: {" + location + "}\n    law: " + law +
         "\n    parameters: {" + parameters + "}\n";
}

const std::string kHead = "format: graybox-lumped/1\nsample_time: 0.01\nmotion: translation\n";
const std::string kOneMass =
    "inputs:\n  - {name: force, mass: body}\noutputs:\n"
    "  - {name: position, mass: body, quantity: position}\n";

// m q'' + d q' + k q + c q^3 = u.
std::string duffing(double m, double d, double k, double c) {
  return kHead + "masses: {body: " + std::to_string(m) + "}\nelements:\n" +
         element("spring", "kind: element, mass: body", "stiffness",
                 "stiffness: {value: " + std::to_string(k) + ", unit: N/m}") +
         element("damper", "kind: element, mass: body", "viscous",
                 "damping: {value: " + std::to_string(d) + ", unit: N s/m}") +
         element("hard", "kind: element, mass: body", "cubic_spring",
                 "stiffness: {value: " + std::to_string(c) + ", unit: N/m^3}") +
         kOneMass;
}

VectorXd noise_of(Eigen::Index count, std::uint64_t seed, double deviation) {
  Random random(seed);
  return VectorXd::NullaryExpr(count, [&] { return deviation * random.normal(); });
}

// A smooth random input.
VectorXd smooth_input(Eigen::Index count, std::uint64_t seed, double size) {
  VectorXd values = noise_of(count, seed, 1.0);
  for (int pass = 0; pass < 3; ++pass) {
    for (Eigen::Index k = 1; k < count; ++k) values(k) = 0.8 * values(k - 1) + 0.2 * values(k);
  }
  return values * (size / std::sqrt(values.squaredNorm() / static_cast<double>(count)));
}

OutputErrorRecording recording_of(const Eigen::MatrixXd& inputs, Eigen::Index outputs,
                                  double step = 0.01,
                                  ExperimentRole role = ExperimentRole::kEstimation) {
  OutputErrorRecording run;
  run.name = "run";
  run.role = role;
  run.time = VectorXd::LinSpaced(inputs.rows(), 0.0, step * static_cast<double>(inputs.rows() - 1));
  run.inputs = inputs;
  run.outputs = Eigen::MatrixXd::Random(inputs.rows(), outputs);
  return run;
}

OutputErrorData data_of(std::vector<OutputErrorRecording> runs, InputHold hold) {
  const auto outputs = runs.front().outputs.cols();
  return {.hold = hold, .noise = VectorXd::Zero(outputs), .recordings = std::move(runs)};
}

Rows simulate(const OutputErrorProblem& problem, const VectorXd& theta, const VectorXd& initial,
              bool with_derivatives) {
  const auto whole = problem.whole_recordings(ExperimentRole::kEstimation);
  std::vector<Simulated> runs;
  std::vector<VectorXd> states;
  if (initial.size() > 0) states.push_back(initial);
  problem.simulate(theta, {whole.data(), 1}, states, with_derivatives, runs);
  EXPECT_TRUE(runs[0].finite);
  return runs[0].outputs;
}

// The output of `model` at its own parameters becomes the recording, with noise.
void record(const LumpedModel& model, OutputErrorData& data, double noise, std::uint64_t seed,
            const VectorXd& initial = {}) {
  OutputErrorProblem truth(model, data);
  truth.set_steps_per_sample(8);
  for (std::size_t k = 0; k < data.recordings.size(); ++k) {
    const std::vector<StretchOf> whole{{k, {0, data.recordings[k].time.size()}}};
    std::vector<Simulated> runs;
    std::vector<VectorXd> states;
    if (initial.size() > 0) states.push_back(initial);
    truth.simulate(truth.start(), whole, states, false, runs);
    ASSERT_TRUE(runs[0].finite);
    auto& outputs = data.recordings[k].outputs;
    const Eigen::Index ny = outputs.cols();
    for (Eigen::Index t = 0; t < outputs.rows(); ++t) {
      outputs.row(t) = runs[0].outputs.col(0).segment(t * ny, ny).transpose();
    }
    for (Eigen::Index j = 0; j < ny; ++j) {
      outputs.col(j) +=
          noise_of(outputs.rows(), seed + 7 * k + static_cast<std::uint64_t>(j), noise);
    }
  }
}

// ---- inputs between samples ---------------------------------------------------------------------

TEST(NodeInputs, FollowTheirHold) {
  Eigen::MatrixXd values(4, 1);
  values << 1.0, 3.0, -2.0, 5.0;
  const NodeInputs zero = node_inputs(values, InputHold::kZero, 2);
  EXPECT_EQ(zero.nodes.leftCols(6), Eigen::MatrixXd::Constant(1, 6, 1.0));
  EXPECT_EQ(zero.nodes(0, 6), 3.0);
  const NodeInputs first = node_inputs(values, InputHold::kFirst, 1);
  EXPECT_EQ(first.nodes, (Eigen::MatrixXd(1, 9) << 1, 2, 3, 3, 0.5, -2, -2, 1.5, 5).finished());
  EXPECT_EQ(first.samples, values.transpose());
}

// A sine up to nearly the Nyquist frequency comes back between its samples.
TEST(NodeInputs, BandLimitedInputsAreRebuilt) {
  for (const double frequency : {0.01, 0.2, 0.4, 0.45}) {
    const Eigen::Index count = 400;
    const auto sine = [&](double t) {
      return std::sin(2.0 * std::numbers::pi * frequency * t + 0.3);
    };
    Eigen::MatrixXd values(count, 1);
    for (Eigen::Index k = 0; k < count; ++k) values(k, 0) = sine(static_cast<double>(k));
    VectorXd delay(1);
    delay << 1.3;
    const NodeInputs nodes = node_inputs(values, InputHold::kBandLimited, 1);
    const NodeInputs later = node_inputs(values, InputHold::kBandLimited, 1, delay, true);
    for (Eigen::Index k = 60; k < 340; ++k) {
      for (const Eigen::Index node : {0, 1, 2}) {
        const double t = static_cast<double>(k) + 0.5 * static_cast<double>(node);
        EXPECT_NEAR(nodes.nodes(0, 3 * k + node), sine(t), 2e-3);
        EXPECT_NEAR(later.nodes(0, 3 * k + node), sine(t - 1.3), 2e-3);
        const double slope = -(sine(t - 1.3 + 1e-5) - sine(t - 1.3 - 1e-5)) / 2e-5;
        EXPECT_NEAR(later.slopes(0, 3 * k + node), slope, 2e-2);
      }
    }
  }
}

// A delayed hold has the integrals of the true signal over each step, of 1, t and t^2.
TEST(NodeInputs, DelayedHoldsKeepTheirMoments) {
  Eigen::MatrixXd values(6, 1);
  values << 1.0, 3.0, -2.0, 5.0, 0.5, -1.0;
  VectorXd delay(1);
  delay << 1.7;
  const NodeInputs nodes = node_inputs(values, InputHold::kZero, 2, delay, true);
  const auto held = [&](double t) {
    return values(std::max<Eigen::Index>(0, static_cast<Eigen::Index>(std::floor(t - 1.7))), 0);
  };
  for (Eigen::Index step = 0; step < 10; ++step) {
    const auto p = nodes.nodes.middleCols(3 * step, 3);
    for (int power = 0; power < 3; ++power) {
      double direct = 0.0, parabola = 0.0;
      constexpr int kPoints = 20000;
      for (int i = 0; i < kPoints; ++i) {
        const double s = (i + 0.5) / kPoints;
        const double weight = std::pow(s, power) / kPoints;
        direct += weight * held(0.5 * (static_cast<double>(step) + s));
        parabola += weight * (p(0, 0) * (1 - s) * (1 - 2 * s) + p(0, 1) * 4 * s * (1 - s) +
                              p(0, 2) * s * (2 * s - 1));
      }
      EXPECT_NEAR(direct, parabola, 1e-3) << step << " " << power;
    }
  }
}

// ---- trajectories -------------------------------------------------------------------------------

// A linear oscillator under a held step: the closed form, at any number of steps.
TEST(Trajectory, IsExactForLinearModels) {
  const LumpedModel model = model_of(duffing(2.0, 0.8, 50.0, 0.0));
  OutputErrorProblem problem(
      model, data_of({recording_of(Eigen::MatrixXd::Constant(300, 1, 3.0), 1)}, InputHold::kZero));
  VectorXd initial(2);
  initial << 0.1, -0.4;
  const Rows found = simulate(problem, problem.start(), initial, false);
  const double decay = 0.8 / 4.0, w = std::sqrt(25.0 - decay * decay), rest = 3.0 / 50.0;
  for (Eigen::Index k = 0; k < 300; ++k) {
    const double t = 0.01 * static_cast<double>(k);
    const double a = 0.1 - rest, b = (-0.4 + decay * a) / w;
    EXPECT_NEAR(found(k, 0),
                rest + std::exp(-decay * t) * (a * std::cos(w * t) + b * std::sin(w * t)), 1e-11);
  }
}

struct Duffing {
  double p[4];  // m, d, k, c
  const VectorXd* input;
};

int duffing_rate(double t, N_Vector state, N_Vector rate, void* data) {
  const auto& system = *static_cast<Duffing*>(data);
  const double* p = system.p;
  const double* y = N_VGetArrayPointer(state);
  const auto k =
      std::min<Eigen::Index>(static_cast<Eigen::Index>(t / 0.01), system.input->size() - 2);
  const double part = t / 0.01 - static_cast<double>(k);
  const double u = (1.0 - part) * (*system.input)(k) + part * (*system.input)(k + 1);
  double* change = N_VGetArrayPointer(rate);
  change[0] = y[1];
  change[1] = (u - p[1] * y[1] - p[2] * y[0] - p[3] * y[0] * y[0] * y[0]) / p[0];
  return 0;
}

// Output and sensitivities against CVODES (its own forward sensitivities, another integrator).
TEST(Trajectory, AgreesWithCvodesForwardSensitivities) {
  constexpr Eigen::Index kSamples = 120;
  const VectorXd input = smooth_input(kSamples, 5, 20.0);
  Duffing system{{2.0, 0.8, 50.0, 400.0}, &input};
  OutputErrorProblem problem(model_of(duffing(2.0, 0.8, 50.0, 400.0)),
                             data_of({recording_of(input, 1)}, InputHold::kFirst));
  problem.set_steps_per_sample(8);
  VectorXd initial(2);
  initial << 0.2, 0.5;
  const Rows found = simulate(problem, problem.start(), initial, true);

  SUNContext context = nullptr;
  ASSERT_EQ(SUNContext_Create(nullptr, &context), 0);
  N_Vector y = N_VNew_Serial(2, context);
  N_VGetArrayPointer(y)[0] = initial(0);
  N_VGetArrayPointer(y)[1] = initial(1);
  N_Vector* s = N_VCloneVectorArray(4, y);
  for (int i = 0; i < 4; ++i) N_VConst(0.0, s[i]);
  SUNMatrix matrix = SUNDenseMatrix(2, 2, context);
  SUNLinearSolver solver = SUNLinSol_Dense(y, matrix, context);
  void* memory = CVodeCreate(CV_BDF, context);
  ASSERT_EQ(CVodeInit(memory, duffing_rate, 0.0, y), 0);
  ASSERT_EQ(CVodeSetUserData(memory, &system), 0);
  ASSERT_EQ(CVodeSStolerances(memory, 1e-9, 1e-11), 0);
  ASSERT_EQ(CVodeSetMaxNumSteps(memory, 100000), 0);
  ASSERT_EQ(CVodeSetLinearSolver(memory, solver, matrix), 0);
  ASSERT_EQ(CVodeSensInit1(memory, 4, CV_STAGGERED, nullptr, s), 0);
  ASSERT_EQ(CVodeSensEEtolerances(memory), 0);
  ASSERT_EQ(CVodeSetSensErrCon(memory, 1), 0);
  ASSERT_EQ(CVodeSetSensParams(memory, system.p, system.p, nullptr), 0);
  // Order of parameters here: mass, spring, damper, hard; there: m, d, k, c.
  const int column[4] = {1, 3, 2, 4};
  double reached = 0.0;
  for (Eigen::Index k = 10; k < kSamples; k += 20) {
    ASSERT_GE(CVode(memory, 0.01 * static_cast<double>(k), y, &reached, CV_NORMAL), 0);
    ASSERT_EQ(CVodeGetSens(memory, &reached, s), 0);
    EXPECT_NEAR(found(k, 0), N_VGetArrayPointer(y)[0], 2e-6);
    for (int i = 0; i < 4; ++i) {
      const double scale = found.col(column[i]).cwiseAbs().maxCoeff();
      EXPECT_NEAR(found(k, column[i]), N_VGetArrayPointer(s[i])[0], 2e-4 * scale) << k << " " << i;
    }
  }
  N_VDestroyVectorArray(s, 4);
  N_VDestroy(y);
  CVodeFree(&memory);
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
  SUNContext_Free(&context);
}

// Two masses, one law of each kind, signals with laws and a delay, all outputs there are.
std::string everything() {
  const std::string between = "kind: element, between: [motor, load]";
  return kHead + "masses: {motor: 0.5, load: 1.5}\nelements:\n" +
         element("shaft", between, "stiffness", "stiffness: {value: 80, unit: N/m}") +
         element("loss", between, "viscous", "damping: {value: 0.7, unit: N s/m}") +
         element("rotor", "kind: element, deflection: {motor: 1, load: -0.3}", "inertia",
                 "inertia: {value: 0.1, unit: kg}") +
         element("friction", "kind: element, mass: load", "stribeck",
                 "level: {value: 0.5, unit: N}, static_level: {value: 0.8, unit: N}, "
                 "stribeck_velocity: {value: 0.2, unit: m/s}, "
                 "transition_velocity: {value: 0.1, unit: m/s}") +
         element("bristles", "kind: element, mass: motor", "dahl",
                 "stiffness: {value: 30, unit: N/m}, level: {value: 0.4, unit: N}") +
         element("cross", "kind: element, mass: load, driven_by: {mass: motor}", "cubic_spring",
                 "stiffness: {value: 3, unit: N/m^3}") +
         element("arm", "kind: element, mass: load", "mode",
                 "inertia: {value: 0.2, unit: kg}, frequency: {value: 3, unit: Hz}, "
                 "damping_ratio: {value: 0.1, unit: '1'}") +
         element("amplifier", "kind: actuator, input: force", "lag",
                 "time_constant: {value: 0.02, unit: s}") +
         element("gain", "kind: actuator, input: force", "gain", "error: {value: 0.1, unit: '1'}") +
         element("late", "kind: actuator, input: force", "delay", "time: {value: 0.013, unit: s}") +
         element("filter", "kind: sensor, output: speed", "lag",
                 "time_constant: {value: 0.03, unit: s}") +
         element("bias", "kind: sensor, output: speed", "offset",
                 "value: {value: 0.01, unit: m/s}") +
         "inputs:\n  - {name: force, mass: motor}\noutputs:\n"
         "  - {name: x, mass: load, quantity: position}\n"
         "  - {name: speed, mass: motor, quantity: velocity}\n"
         "  - {name: a, mass: load, quantity: acceleration}\n"
         "  - {name: f, element: shaft, quantity: force}\n";
}

void expect_exact_derivatives(const OutputErrorProblem& problem, const VectorXd& initial,
                              double tolerance) {
  const VectorXd theta = problem.start();
  const Rows found = simulate(problem, theta, initial, true);
  const Eigen::Index p = theta.size();
  for (Eigen::Index i = 0; i < p + initial.size(); ++i) {
    VectorXd up = theta, down = theta, up_state = initial, down_state = initial;
    const double h = i < p ? 1e-6 * std::max(std::abs(theta(i)), 1e-2) : 1e-6;
    (i < p ? up(i) : up_state(i - p)) += h;
    (i < p ? down(i) : down_state(i - p)) -= h;
    const VectorXd slope = (simulate(problem, up, up_state, false).col(0) -
                            simulate(problem, down, down_state, false).col(0)) /
                           (2.0 * h);
    const double scale = slope.cwiseAbs().maxCoeff() + 1e-9;
    EXPECT_LT((found.col(1 + i) - slope).cwiseAbs().maxCoeff(), tolerance * scale)
        << (i < p ? problem.model()
                        .parameters[problem.free_parameters()[static_cast<std::size_t>(i)]]
                        .name
                  : "initial state");
  }
}

// All derivatives of what the steps compute, against central differences of the same.
TEST(Trajectory, DerivativesAreThoseOfTheSteps) {
  const VectorXd input = smooth_input(150, 3, 6.0);
  VectorXd initial(4);
  initial << 0.05, -0.02, 0.3, 0.1;
  for (const InputHold hold : {InputHold::kZero, InputHold::kFirst, InputHold::kBandLimited}) {
    const OutputErrorProblem problem(model_of(everything()),
                                     data_of({recording_of(input, 4)}, hold));
    expect_exact_derivatives(problem, initial, 2e-5);
  }
  // Uneven times: Runge-Kutta steps.
  OutputErrorRecording uneven = recording_of(input, 4);
  uneven.even = false;
  for (Eigen::Index k = 0; k < uneven.time.size(); ++k) {
    uneven.time(k) += 0.003 * std::sin(static_cast<double>(k));
  }
  const OutputErrorProblem problem(model_of(everything()), data_of({uneven}, InputHold::kFirst));
  expect_exact_derivatives(problem, initial, 2e-5);
}

// Halved steps: the error falls by 2^4.
TEST(Trajectory, IsOfFourthOrder) {
  const VectorXd input = smooth_input(100, 4, 30.0);
  OutputErrorProblem problem(model_of(duffing(1.0, 0.5, 40.0, 900.0)),
                             data_of({recording_of(input, 1, 0.05)}, InputHold::kFirst));
  const VectorXd initial = VectorXd::Constant(2, 0.3);
  problem.set_steps_per_sample(64);
  const VectorXd exact = simulate(problem, problem.start(), initial, false).col(0);
  double before = 0.0;
  for (const int steps : {2, 4, 8}) {
    problem.set_steps_per_sample(steps);
    const double error = (simulate(problem, problem.start(), initial, false).col(0) - exact).norm();
    if (before > 0.0) {
      EXPECT_GT(before / error, 11.0) << steps;
      EXPECT_LT(before / error, 24.0) << steps;
    }
    before = error;
  }
}

// Imposed motion: the force of springs, dampers, mass and hysteresis, and a mass that follows.
TEST(Trajectory, ImposedMotionTakesTheForceOfItsElements) {
  const std::string text =
      kHead + "masses: {rod: 2}\nelements:\n" +
      element("spring", "kind: element, mass: rod", "stiffness",
              "stiffness: {value: 7, unit: N/m}") +
      element("damper", "kind: element, mass: rod", "viscous", "damping: {value: 3, unit: N s/m}") +
      element("hard", "kind: element, mass: rod", "cubic_spring",
              "stiffness: {value: 5, unit: N/m^3}") +
      "inputs:\n  - {name: x, mass: rod, quantity: position}\n"
      "  - {name: v, mass: rod, quantity: velocity}\n"
      "  - {name: a, mass: rod, quantity: acceleration}\n"
      "outputs:\n  - {name: force, mass: rod, quantity: force}\n";
  const Eigen::MatrixXd motion = Eigen::MatrixXd::Random(40, 3);
  OutputErrorProblem problem(model_of(text), data_of({recording_of(motion, 1)}, InputHold::kFirst));
  const Rows found = simulate(problem, problem.start(), {}, true);
  for (Eigen::Index k = 0; k < 40; ++k) {
    const double x = motion(k, 0), v = motion(k, 1), a = motion(k, 2);
    EXPECT_NEAR(found(k, 0), 2 * a + 3 * v + 7 * x + 5 * x * x * x, 1e-12);
    EXPECT_NEAR(found(k, 1), a, 1e-12);
    EXPECT_NEAR(found(k, 2), x, 1e-12);
    EXPECT_NEAR(found(k, 3), v, 1e-12);
    EXPECT_NEAR(found(k, 4), x * x * x, 1e-12);
  }
  // A base that shakes a mass: the same as the force k x + d v on it.
  const std::string link = "kind: element, between: [body, base]";
  const std::string linear =
      element("spring", link, "stiffness", "stiffness: {value: 30, unit: N/m}") +
      element("damper", link, "viscous", "damping: {value: 1, unit: N s/m}");
  const OutputErrorProblem shaken(
      model_of(kHead + "masses: {base: 0, body: 0.5}\nelements:\n" + linear +
               "inputs:\n  - {name: x, mass: base, quantity: position}\n"
               "  - {name: v, mass: base, quantity: velocity}\n"
               "outputs:\n  - {name: y, mass: body, quantity: position}\n"),
      data_of({recording_of(motion.leftCols(2), 1)}, InputHold::kFirst));
  const OutputErrorProblem pushed(
      model_of(duffing(0.5, 1.0, 30.0, 0.0)),
      data_of({recording_of(30.0 * motion.col(0) + motion.col(1), 1)}, InputHold::kFirst));
  EXPECT_LT(
      (simulate(shaken, shaken.start(), {}, false) - simulate(pushed, pushed.start(), {}, false))
          .norm(),
      1e-12);
}

// ---- sensors that come late or pick up other signals --------------------------------------------

// Two readings of one imposed angle, the second late, with what a measured torque adds to it.
std::string two_encoders(double time, double gain) {
  return "format: graybox-lumped/1\nsample_time: 0.01\nmotion: rotation\nmasses: {joint: "
         "0}\nelements:\n" +
         element("skew", "kind: sensor, output: reading", "delay",
                 "time: {value: " + std::to_string(time) + ", unit: s}") +
         element("compliance", "kind: sensor, output: reading, driven_by: {input: torque}",
                 "feedthrough", "gain: {value: " + std::to_string(gain) + ", unit: rad/(N m)}") +
         "inputs:\n  - {name: angle, mass: joint, quantity: position}\n"
         "  - {name: torque, quantity: signal, unit: N m}\n"
         "outputs:\n  - {name: reading, mass: joint, quantity: position}\n";
}

// Cubics between samples are followed exactly; before the first sample its value is held.
TEST(OutputDelay, IsExactForCubics) {
  const VectorXd time = VectorXd::LinSpaced(30, 0.0, 0.29);
  const auto cubic = [](double t) { return 2.0 - t + 30.0 * t * t - 50.0 * t * t * t; };
  const auto slope = [](double t) { return -1.0 + 60.0 * t - 150.0 * t * t; };
  VectorXd uneven = time;
  for (Eigen::Index k = 0; k < time.size(); ++k)
    uneven(k) += 0.002 * std::sin(3.0 * time(k) / 0.01);
  for (const VectorXd& at : {time, uneven}) {
    for (const double delay : {0.0, 0.004, 0.0237}) {
      Rows outputs = Rows::Zero(30, 2);
      for (Eigen::Index k = 0; k < 30; ++k) outputs(k, 0) = cubic(at(k));
      delay_outputs(at, VectorXd::Constant(1, delay), {1}, outputs);
      for (Eigen::Index k = 0; k < 30; ++k) {
        const bool held = at(k) - delay <= at(0);
        EXPECT_NEAR(outputs(k, 0), held ? cubic(at(0)) : cubic(at(k) - delay), 1e-12) << k;
        EXPECT_NEAR(outputs(k, 1), held ? 0.0 : -slope(at(k) - delay), 1e-9) << k;
      }
    }
  }
}

TEST(Trajectory, SensorsMayBeLateAndDriven) {
  Eigen::MatrixXd inputs(200, 2);
  inputs << smooth_input(200, 5, 1.0), smooth_input(200, 6, 40.0);
  const OutputErrorProblem problem(model_of(two_encoders(0.0137, 2e-3)),
                                   data_of({recording_of(inputs, 1)}, InputHold::kFirst));
  const Rows prompt = simulate(problem, Eigen::Vector2d(0.0, 2e-3), {}, false);
  EXPECT_LT((prompt.col(0) - inputs.col(0) - 2e-3 * inputs.col(1)).norm(), 1e-12);
  expect_exact_derivatives(problem, {}, 1e-6);
  // A plant, whose derivatives by its own parameters come late, too.
  const std::string late = everything() + "parameters: [skew.time, shaft.stiffness, pickup.gain]\n";
  const std::string sensors =
      element("skew", "kind: sensor, output: x", "delay", "time: {value: 0.017, unit: s}") +
      element("pickup", "kind: sensor, output: speed, driven_by: {input: force}", "feedthrough",
              "gain: {value: 0.01, unit: m/s/N}");
  const std::size_t at = late.find("inputs:");
  const OutputErrorProblem plant(
      model_of(late.substr(0, at) + sensors + late.substr(at)),
      data_of({recording_of(smooth_input(150, 3, 6.0), 4)}, InputHold::kFirst));
  expect_exact_derivatives(plant, Eigen::Vector4d(0.05, -0.02, 0.3, 0.1), 2e-5);
}

TEST(OutputErrorFit, FindsTheSkewOfTwoEncodersAndTheComplianceBetweenThem) {
  const auto run = [](std::uint64_t seed, ExperimentRole role) {
    Eigen::MatrixXd inputs(600, 2);
    inputs << smooth_input(600, seed, 1.0), smooth_input(600, seed + 1, 40.0);
    return recording_of(inputs, 1, 0.01, role);
  };
  OutputErrorData data =
      data_of({run(11, ExperimentRole::kEstimation), run(21, ExperimentRole::kValidation)},
              InputHold::kFirst);
  record(model_of(two_encoders(0.0137, -2e-4)), data, 1e-4, 3);
  OutputErrorProblem problem(model_of(two_encoders(0.01, 0.0)), data);
  const OutputErrorFit fit = fit_output_error(problem, {.starts = 1});
  ASSERT_EQ(fit.status, OutputErrorStatus::kConverged);
  const VectorXd error = fit.theta - Eigen::Vector2d(0.0137, -2e-4);
  for (Eigen::Index i = 0; i < 2; ++i)
    EXPECT_LT(std::abs(error(i)), 4.0 * fit.standard_errors()(i));
  EXPECT_NEAR(fit.validation.rms(0), 1e-4, 2e-5);
  EXPECT_LE(fit.validation.deviation(0), fit.validation.rms(0));
}

// ---- fits ---------------------------------------------------------------------------------------

// Sizes off by orders of magnitude: linear ones come to their optimum at once, and others stay.
TEST(LinearStart, FindsTheSizesOfLawsUnderImposedMotion) {
  const auto rod = [](double k, double d, double level, double gap) {
    return kHead + "masses: {rod: 0}\nelements:\n" +
           element("spring", "kind: element, mass: rod", "stiffness",
                   "stiffness: {value: " + std::to_string(k) + ", unit: N/m}") +
           element("damper", "kind: element, mass: rod", "viscous",
                   "damping: {value: " + std::to_string(d) + ", unit: N s/m}") +
           element("stop", "kind: element, mass: rod", "dead_zone",
                   "clearance: {value: " + std::to_string(gap) +
                       ", unit: m}, stiffness: {value: " + std::to_string(level) + ", unit: N/m}") +
           "inputs:\n  - {name: x, mass: rod, quantity: position}\n"
           "outputs:\n  - {name: force, mass: rod, quantity: force}\n";
  };
  OutputErrorData data = data_of({recording_of(smooth_input(400, 8, 1.0), 1)}, InputHold::kFirst);
  record(model_of(rod(30.0, 2.0, 50.0, 0.4)), data, 0.0, 1);
  const OutputErrorProblem problem(model_of(rod(3e4, 1e-3, 2.0, 0.4)), data);
  const VectorXd found = with_linear_optimum(problem, problem.start(), VectorXd::Ones(1));
  EXPECT_LT((found - Eigen::Vector4d(30.0, 2.0, 0.4, 50.0)).norm(), 1e-7);
  // Free motion is not linear in anything.
  const OutputErrorProblem free(
      model_of(duffing(1.0, 0.5, 40.0, 900.0)),
      data_of({recording_of(smooth_input(400, 8, 1.0), 1)}, InputHold::kFirst));
  EXPECT_EQ(with_linear_optimum(free, free.start(), VectorXd::Ones(1)), free.start());
}

// From starts off by three either way the truth comes back within its standard errors.
TEST(OutputErrorFit, FindsTheTruthFromBadStarts) {
  OutputErrorData data =
      data_of({recording_of(smooth_input(800, 1, 30.0), 1),
               recording_of(smooth_input(500, 2, 30.0), 1, 0.01, ExperimentRole::kValidation)},
              InputHold::kZero);
  VectorXd initial(2);
  initial << 0.3, -0.2;
  record(model_of(duffing(2.0, 0.8, 50.0, 400.0)), data, 0.01, 11, initial);
  OutputErrorProblem problem(model_of(duffing(6.0, 0.27, 150.0, 135.0)), data);
  const OutputErrorFit fit = fit_output_error(problem);
  ASSERT_EQ(fit.status, OutputErrorStatus::kConverged);
  VectorXd truth(4);
  truth << 2.0, 50.0, 0.8, 400.0;
  const VectorXd error = fit.theta - truth;
  // Four degrees of freedom: beyond 23.5 once in 10 000.
  EXPECT_LT(error.dot(fit.white_covariance.ldlt().solve(error)), 23.5);
  EXPECT_LT(error.cwiseQuotient(fit.standard_errors()).cwiseAbs().maxCoeff(), 6.0);
  EXPECT_LT((fit.standard_errors().cwiseQuotient(truth)).maxCoeff(), 0.1);
  EXPECT_NEAR(fit.noise(0), 0.01, 0.001);
  EXPECT_NEAR(fit.validation.rms(0), 0.01, 0.002);
  EXPECT_LT(std::abs(fit.lag_one_correlation), 0.15);
  EXPECT_LE(fit.step_error, 1e-4);
}

// A mass with friction alone drifts: no restoring force, free runs from bad starts leave for ever.
TEST(OutputErrorFit, FitsADriftingAxis) {
  const auto axis = [](double m, double d, double c) {
    return kHead + "masses: {body: " + std::to_string(m) + "}\nelements:\n" +
           element("viscous", "kind: element, mass: body", "viscous",
                   "damping: {value: " + std::to_string(d) + ", unit: N s/m}") +
           element("dry", "kind: element, mass: body", "coulomb",
                   "level: {value: " + std::to_string(c) +
                       ", unit: N}, transition_velocity: {value: 0.05, unit: m/s, fixed: true}") +
           kOneMass;
  };
  OutputErrorData data = data_of({recording_of(smooth_input(1500, 8, 40.0), 1)}, InputHold::kZero);
  record(model_of(axis(10.0, 5.0, 4.0)), data, 0.002, 21);
  OutputErrorProblem problem(model_of(axis(30.0, 1.7, 12.0)), data);
  ASSERT_EQ(problem.free_parameters().size(), 3U);
  const OutputErrorFit fit = fit_output_error(problem);
  ASSERT_EQ(fit.status, OutputErrorStatus::kConverged);
  EXPECT_NEAR(fit.theta(0), 10.0, 6.0 * fit.standard_errors()(0));
  EXPECT_NEAR(fit.theta(1), 5.0, 6.0 * fit.standard_errors()(1));
  EXPECT_NEAR(fit.theta(2), 4.0, 6.0 * fit.standard_errors()(2));
  EXPECT_LT(fit.standard_errors()(0), 0.1);
  EXPECT_LT(fit.estimation.nrmse(0), 1.0);
}

// Two springs in parallel: only their sum is seen, and the fit says so.
TEST(OutputErrorFit, NamesWhatTheDataDoNotSee) {
  std::string text = duffing(2.0, 0.8, 50.0, 400.0);
  text.insert(text.find("inputs:"), element("second", "kind: element, mass: body", "stiffness",
                                            "stiffness: {value: 10, unit: N/m}"));
  OutputErrorData data = data_of({recording_of(smooth_input(300, 1, 30.0), 1)}, InputHold::kZero);
  record(model_of(text), data, 0.01, 31);
  OutputErrorProblem problem(model_of(text), data);
  const OutputErrorFit fit = fit_output_error(problem);
  EXPECT_EQ(fit.status, OutputErrorStatus::kUnidentifiable);
  EXPECT_EQ(fit.covariance.size(), 0);
  ASSERT_EQ(fit.identifiability.unseen.size(), 1U);
  const std::string& words = fit.identifiability.unseen[0].words;
  EXPECT_NE(words.find("spring.stiffness"), std::string::npos) << words;
  EXPECT_NE(words.find("second.stiffness"), std::string::npos) << words;
  EXPECT_EQ(words.find("hard"), std::string::npos) << words;
}

// The model fitted to its own outputs with this noise, from rest; its third law held.
OutputErrorFit fit_with_noise(const LumpedModel& truth, const OutputErrorData& exact,
                              const VectorXd& noise) {
  OutputErrorData data = exact;
  data.recordings[0].outputs.col(0) += noise;
  LumpedModel start = truth;
  start.parameters[3].fixed = true;
  OutputErrorProblem problem(start, data);
  return fit_output_error(
      problem, {.initial_state = InitialState::kRest, .equation_error = false, .starts = 0});
}

// Coverage of one standard error, white noise and noise with memory: 40 fits each. The white
// covariance holds for the first alone, the robust one for both.
TEST(OutputErrorFit, StandardErrorsCoverTheTruth) {
  constexpr Eigen::Index kSamples = 800;
  const LumpedModel truth = model_of(duffing(2.0, 0.8, 50.0, 0.0));
  const VectorXd input = smooth_input(kSamples, 6, 30.0);
  constexpr int kFits = 40;
  for (const double memory : {0.0, 0.9}) {
    double robust = 0.0, white = 0.0;
    OutputErrorData exact = data_of({recording_of(input, 1)}, InputHold::kZero);
    record(truth, exact, 0.0, 1);
    for (int k = 0; k < kFits; ++k) {
      VectorXd noise = noise_of(kSamples, 1000 + static_cast<std::uint64_t>(k), 0.01);
      for (Eigen::Index t = 1; t < kSamples; ++t) noise(t) += memory * noise(t - 1);
      const OutputErrorFit fit = fit_with_noise(truth, exact, noise);
      ASSERT_EQ(fit.status, OutputErrorStatus::kConverged);
      VectorXd error(3);
      error << fit.theta(0) - 2.0, fit.theta(1) - 50.0, fit.theta(2) - 0.8;
      robust += error.cwiseQuotient(fit.standard_errors()).squaredNorm();
      white += error.cwiseQuotient(fit.white_covariance.diagonal().cwiseSqrt()).squaredNorm();
    }
    // Mean square of 3 x 40 standardised errors: 1, with a standard deviation of about 0.13.
    robust /= 3 * kFits;
    white /= 3 * kFits;
    EXPECT_GT(robust, 0.6) << memory;
    EXPECT_LT(robust, 1.6) << memory << ' ' << white;
    if (memory == 0.0) {
      EXPECT_NEAR(white, 1.0, 0.45);
    } else {
      EXPECT_GT(white, 2.5);
    }
  }
}

// Input and noise change as slowly as the recording is long: errors from samples that follow each
// other alone are far too small. They cover the truth in 24 of these 40 fits.
TEST(OutputErrorFit, StandardErrorsAllowForWhatDrifts) {
  constexpr Eigen::Index kSamples = 1600;
  constexpr int kFits = 40;
  constexpr double kMemory = 0.998;
  const LumpedModel truth = model_of(duffing(2.0, 0.8, 50.0, 0.0));
  const VectorXd angle = VectorXd::LinSpaced(kSamples, 0.0, 4.0 * std::numbers::pi);
  OutputErrorData exact =
      data_of({recording_of(30.0 * angle.array().sin().matrix(), 1)}, InputHold::kZero);
  record(truth, exact, 0.0, 1);
  int covered = 0;
  for (int k = 0; k < kFits; ++k) {
    VectorXd drift = noise_of(kSamples, 3000 + static_cast<std::uint64_t>(k), 0.002);
    for (Eigen::Index t = 1; t < kSamples; ++t) drift(t) += kMemory * drift(t - 1);
    const OutputErrorFit fit = fit_with_noise(truth, exact, drift);
    ASSERT_EQ(fit.status, OutputErrorStatus::kConverged);
    ASSERT_GT(fit.lag_one_correlation, 0.9);
    covered += std::abs(fit.theta(1) - 50.0) <= 1.96 * fit.standard_errors()(1) ? 1 : 0;
  }
  EXPECT_GE(covered, 34);  // of 40 at 95 %: fewer once in 100
}

// A spring that is not the same in every recording: errors inside each recording are far too small.
TEST(OutputErrorFit, StandardErrorsAllowForTheSpreadBetweenRecordings) {
  constexpr Eigen::Index kSamples = 400;
  constexpr int kFits = 30, kRecordings = 5;
  Random random(21);
  int covered = 0;
  double white = 0.0;
  for (int k = 0; k < kFits; ++k) {
    OutputErrorData all;
    for (int g = 0; g < kRecordings; ++g) {
      const LumpedModel own =
          model_of(duffing(2.0, 0.8, 50.0 * (1.0 + 0.03 * random.normal()), 0.0));
      const auto seed = static_cast<std::uint64_t>(100 * k + g);
      OutputErrorData one =
          data_of({recording_of(smooth_input(kSamples, 7 + seed, 30.0), 1)}, InputHold::kZero);
      record(own, one, 0.01, 5000 + seed);
      if (g == 0) {
        all = one;
      } else {
        all.recordings.push_back(one.recordings[0]);
      }
    }
    LumpedModel start = model_of(duffing(2.0, 0.8, 50.0, 0.0));
    start.parameters[3].fixed = true;
    OutputErrorProblem problem(start, all);
    const OutputErrorFit fit = fit_output_error(
        problem, {.initial_state = InitialState::kRest, .equation_error = false, .starts = 0});
    ASSERT_EQ(fit.status, OutputErrorStatus::kConverged);
    const double error = fit.theta(1) - 50.0;
    covered += std::abs(error) <= 1.96 * fit.standard_errors()(1) ? 1 : 0;
    white += error * error / fit.white_covariance(1, 1) / kFits;
  }
  EXPECT_GE(covered, 25);  // of 30 at 95 %: fewer once in 500
  EXPECT_GT(white, 4.0);
}

TEST(OutputErrorFit, ReportsDivergenceAsAStatus) {
  // A mass on a spring that pushes away: whatever the stiffness, it leaves.
  std::string text = duffing(1.0, 0.1, 1.0, 0.0);
  const std::size_t at = text.find("value: 1.000000, unit: N/m}");
  text.replace(at, 15, "value: -2e7, fixed: true");
  OutputErrorData data = data_of({recording_of(smooth_input(400, 1, 1.0), 1)}, InputHold::kZero);
  OutputErrorProblem problem(model_of(text), data);
  const OutputErrorFit fit = fit_output_error(problem, {.equation_error = false, .starts = 0});
  EXPECT_EQ(fit.status, OutputErrorStatus::kDiverged);
  EXPECT_EQ(fit.covariance.size(), 0);
}

}  // namespace
}  // namespace graybox
