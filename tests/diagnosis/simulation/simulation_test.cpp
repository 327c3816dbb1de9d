// The simulator: excitation, hold timing, plants against each other and against frequency
// responses.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <filesystem>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

#include "diagnosis/signals/multisine.hpp"
#include "diagnosis/simulation/closed_loop.hpp"
#include "diagnosis/simulation/excitation_plan.hpp"
#include "diagnosis/simulation/plant.hpp"
#include "problems/base/error.hpp"
#include "problems/mechanisms/frequency_response.hpp"
#include "tests/support/robot_test_support.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// X(k) = N^(-1/2) sum_t x(t) exp(-2 pi j k t / N), by the sum itself.
Eigen::VectorXcd dft_line(const MatrixXd& signal, std::size_t line) {
  const Eigen::Index n = signal.cols();
  Eigen::VectorXcd wave(n);
  for (Eigen::Index t = 0; t < n; ++t) {
    const auto turns = static_cast<double>((static_cast<Eigen::Index>(line) * t) % n);
    wave(t) = std::polar(1.0, -2.0 * std::numbers::pi * turns / static_cast<double>(n));
  }
  return signal.cast<Complex>() * wave / std::sqrt(static_cast<double>(n));
}

// Columns: sub-experiments.
MatrixXcd line_of(const std::vector<MatrixXd>& signals, std::size_t line) {
  MatrixXcd matrix(signals.front().rows(), static_cast<Eigen::Index>(signals.size()));
  for (std::size_t e = 0; e < signals.size(); ++e) {
    matrix.col(static_cast<Eigen::Index>(e)) = dft_line(signals[e], line);
  }
  return matrix;
}

MultisineOptions six_inputs(std::size_t period) {
  return {.period = period,
          .lines = {1, 5, 9, 21, 45},
          .relative_amplitude = {},
          .inputs = 6,
          .rms = 0.02};
}

TEST(Multisine, IsOrthogonalWithThePowerAsked) {
  MultisineOptions options = six_inputs(400);
  options.relative_amplitude = {1.0, 2.0, 0.5, 1.0, 3.0};
  const Multisine signal(options, 3);
  std::vector<MatrixXd> references;
  for (Eigen::Index e = 0; e < 6; ++e) {
    references.push_back(signal.reference(e));
    for (Eigen::Index a = 0; a < 6; ++a) {
      EXPECT_NEAR(references.back().row(a).norm() / std::sqrt(400.0), 0.02, 1e-14);
    }
  }
  for (std::size_t k = 0; k < options.lines.size(); ++k) {
    const MatrixXcd r = line_of(references, options.lines[k]);
    const double power = signal.amplitudes()[k] * signal.amplitudes()[k];
    EXPECT_LT((r * r.adjoint() - power * MatrixXcd::Identity(6, 6)).norm(), 1e-12 * power);
    EXPECT_NEAR(signal.amplitudes()[k] / signal.amplitudes()[0], options.relative_amplitude[k],
                1e-12);
  }
  for (const std::size_t quiet : {0U, 2U, 3U, 7U, 46U}) {
    EXPECT_LT(line_of(references, quiet).norm(), 1e-13);
  }
}

TEST(Multisine, DrawsPhasesForTheLeastCrestFactor) {
  MultisineOptions options = six_inputs(400);
  const double first = Multisine(options, 5).crest_factor();
  options.phase_draws = 50;
  const Multisine best(options, 5);
  EXPECT_LT(best.crest_factor(), first);
  double peak = 0.0;
  for (Eigen::Index e = 0; e < 6; ++e) {
    peak = std::max(peak, best.reference(e).cwiseAbs().maxCoeff());
  }
  EXPECT_DOUBLE_EQ(best.crest_factor(), peak / 0.02);
}

TEST(Multisine, KeepsACrestLimit) {
  MultisineOptions options = six_inputs(400);
  const double first = Multisine(options, 5).crest_factor();
  options.phase_draws = 200;
  const double least = Multisine(options, 5).crest_factor();
  options.crest_limit = 0.5 * (first + least);
  const double kept = Multisine(options, 5).crest_factor();
  EXPECT_LE(kept, options.crest_limit);
  EXPECT_GE(kept, least);
  options.crest_limit = 0.99 * least;
  EXPECT_THROW(Multisine(options, 5), InputError);
}

// The files of docs/how_to/simulate.md can be read and their plants built.
TEST(SimulatedSystem, ReadsTheExamplesOfTheDocumentation) {
  const std::filesystem::path examples =
      std::filesystem::path(GRAYBOX_SOURCE_DIR) / "docs/examples/simulate";
  const SimulatedSystem robot =
      load_system(robot_test::robot_folder() / "irb6600_like.yaml", examples / "physics.yaml");
  for (const char* name : {"plan.yaml", "quick_plan.yaml"}) {
    const ExcitationPlan plan = read_plan(examples / name, robot);
    for (const VectorXd& position : plan.positions) {
      const auto plant = robot.plant(plan.plant, position * (std::numbers::pi / 180.0));
      EXPECT_EQ(plant->output_count(), 6);
    }
  }
  const SimulatedSystem drive = load_system(examples / "drive.yaml");
  EXPECT_EQ(read_plan(examples / "drive_plan.yaml", drive).levels.size(), 2U);
  EXPECT_EQ(drive.plant(SimulatedSystem::PlantKind::kLumped, {})->input_count(), 1);
}

TEST(Multisine, RefusesWhatItCannotExcite) {
  MultisineOptions options = six_inputs(400);
  options.lines = {5, 5};
  EXPECT_THROW(Multisine(options, 1), InputError);
  options.lines = {200};
  EXPECT_THROW(Multisine(options, 1), InputError);
  options.lines = {0};
  EXPECT_THROW(Multisine(options, 1), InputError);
  options.lines = {};
  EXPECT_THROW(Multisine(options, 1), InputError);
  options = six_inputs(400);
  options.relative_amplitude = {1.0};
  EXPECT_THROW(Multisine(options, 1), InputError);
}

TEST(Multisine, OddLinesNearestToFrequencies) {
  // Resolution 0.25 Hz: lines 4, 8, 21.6 are nearest; odd ones 3 or 5, 7 or 9, 21.
  const auto lines = odd_lines({1.0, 2.0, 5.4}, 8000, 0.0005);
  ASSERT_EQ(lines.size(), 3U);
  for (const std::size_t line : lines) EXPECT_EQ(line % 2, 1U);
  EXPECT_EQ(lines[2], 21U);
  EXPECT_EQ(odd_lines({1.0, 1.01}, 8000, 0.0005).size(), 1U);
}

// Every fourth odd line of the plan is left out, and nothing but the lines that stay is excited.
TEST(ExcitationPlan, LeavesDetectionLinesSilent) {
  const testing::TemporaryFolder folder;
  const auto write_plan = [&](const char* detection) {
    testing::write_text(folder.file("plan.yaml"),
                        std::string("format: graybox-plan/1\nplant: local\n"
                                    "positions: [[0, 30, -60, 0, 45, 0]]\nlevels: [0.5]\n"
                                    "period: 8000\nfrequencies: {from: 5, to: 24, count: 20, "
                                    "spacing: linear}\n") +
                            detection);
    return folder.file("plan.yaml");
  };
  const SimulatedSystem system = load_system(robot_test::robot_folder() / "irb6600_like.yaml");
  const auto all = read_plan(write_plan(""), system).lines;
  const auto excited = read_plan(write_plan("detection_lines: 4\n"), system).lines;
  ASSERT_EQ(all.size(), 20U);
  ASSERT_EQ(excited.size(), 15U);
  const MatrixXd reference =
      Multisine({.period = 8000, .lines = excited, .relative_amplitude = {}, .inputs = 6}, 2)
          .reference(3);
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(all[k] % 2, 1U);
    const bool silent = k % 4 == 3;
    EXPECT_EQ(std::ranges::find(excited, all[k]) == excited.end(), silent);
    EXPECT_EQ(dft_line(reference, all[k]).norm() < 1e-10, silent);
  }
}

// C (z I - Phi)^-1 Gamma from the impulse response of the plant: exact at any sample rate.
TEST(LocalPlant, HoldsItsInputExactly) {
  // One mass on a spring: y'' known in closed form for a held force.
  LocalModel model;
  model.mass = MatrixXd::Constant(1, 1, 2.0);
  model.damping = MatrixXd::Zero(1, 1);
  model.stiffness = MatrixXd::Constant(1, 1, 50.0);
  model.input = model.output = MatrixXd::Identity(1, 1);
  const double step = 0.03, w = 5.0;
  const auto plant = local_plant(model, step);
  const VectorXd push = VectorXd::Constant(1, 3.0), none = VectorXd::Zero(1);
  EXPECT_EQ(plant->output()(0), 0.0);
  plant->advance(push);
  EXPECT_NEAR(plant->output()(0), 3.0 / (2.0 * w) * std::sin(w * step), 1e-14);
  for (int t = 2; t <= 50; ++t) {  // free from the second sample on
    plant->advance(none);
    const double expected =
        3.0 / (2.0 * w) * (std::sin(w * step * t) - std::sin(w * step * (t - 1)));
    EXPECT_NEAR(plant->output()(0), expected, 1e-13);
  }
  plant->restart();
  EXPECT_EQ(plant->output()(0), 0.0);
}

// The sampled response of the local model with a held input, exactly: S (z I - Phi)^-1 Gamma.
MatrixXcd sampled_response(const LocalModel& model, double w, double sample_time) {
  const Eigen::Index n = model.degrees_of_freedom(), m = model.input.cols();
  MatrixXd generator = MatrixXd::Zero(2 * n + m, 2 * n + m);
  generator.block(0, n, n, n).setIdentity();
  const MatrixXd inverse_mass = model.mass.inverse();
  generator.block(n, 0, n, 2 * n + m) << -inverse_mass * model.stiffness,
      -inverse_mass * model.damping, inverse_mass * model.input;
  const MatrixXd transition = (generator * sample_time).exp();
  const MatrixXcd resolvent = std::polar(1.0, w * sample_time) * MatrixXcd::Identity(2 * n, 2 * n) -
                              transition.topLeftCorner(2 * n, 2 * n);
  const MatrixXcd states =
      resolvent.partialPivLu().solve(transition.topRightCorner(2 * n, m).cast<Complex>());
  return model.output.cast<Complex>() * states.bottomRows(n);
}

// In the periodic steady state Y = G U with the exact sampled response, which formula (11) meets up
// to the aliasing it leaves out; and U = F (R - Y).
TEST(ClosedLoop, ReproducesTheFrequencyResponse) {
  const RobotModel robot = robot_test::paper_robot();
  const VectorXd position = robot_test::some_positions()[1];
  const LocalModel model = LocalModelBuilder(robot).build(position);
  const auto plant = local_plant(model, robot.sample_time);
  const MultisineOptions options{
      .period = 4000, .lines = {3, 11, 41, 81, 119}, .inputs = 6, .rms = 0.02};
  const Multisine signal(options, 2);
  std::vector<MatrixXd> references, inputs, outputs;
  for (Eigen::Index e = 0; e < 6; ++e) {
    const Recording recording =
        simulate_closed_loop(*plant, robot.controller, robot.sample_time, signal.reference(e),
                             {.settling_periods = 12, .periods = 1});
    references.push_back(recording.reference);
    inputs.push_back(recording.input);
    outputs.push_back(recording.output);
  }
  for (const std::size_t line : options.lines) {
    const double w =
        2.0 * std::numbers::pi * static_cast<double>(line) / (4000.0 * robot.sample_time);
    const MatrixXcd u = line_of(inputs, line), y = line_of(outputs, line);
    const MatrixXcd r = line_of(references, line);
    const auto f = controller_response(robot.controller, w, robot.sample_time);
    EXPECT_LT((u - f.asDiagonal() * (r - y)).norm(), 1e-5 * u.norm()) << line;
    const MatrixXcd measured = y * u.inverse();
    const MatrixXcd exact = sampled_response(model, w, robot.sample_time);
    EXPECT_LT((measured - exact).norm(), 1e-5 * exact.norm()) << line;
    const MatrixXcd formula = frequency_response(model, w, robot.sample_time);
    EXPECT_LT((formula - exact).norm(), 5e-3 * exact.norm()) << line;
  }
}

TEST(ClosedLoop, NoiseHasTheStatedSpectrum) {
  // No plant dynamics to speak of: a heavy mass under a weak controller, so that y is the noise.
  LocalModel model;
  model.mass = MatrixXd::Constant(1, 1, 1e9);
  model.damping = model.stiffness = MatrixXd::Zero(1, 1);
  model.input = model.output = MatrixXd::Identity(1, 1);
  const double step = 0.0005, slope = 4e-6;
  const auto plant = local_plant(model, step);
  const PiController controller{VectorXd::Constant(1, 1e-6), VectorXd::Constant(1, 1.0)};
  constexpr Eigen::Index kPeriod = 100;
  constexpr std::size_t kPeriods = 4000;
  const Recording recording = simulate_closed_loop(
      *plant, controller, step, MatrixXd::Zero(1, kPeriod),
      {.settling_periods = 0, .periods = kPeriods, .noise_psd_slope = slope, .seed = 7});
  for (const std::size_t line : {1U, 10U, 40U}) {
    double power = 0.0;
    for (std::size_t p = 0; p < kPeriods; ++p) {
      power +=
          dft_line(recording.output.middleCols(static_cast<Eigen::Index>(p) * kPeriod, kPeriod),
                   line)
              .squaredNorm();
    }
    power /= static_cast<double>(kPeriods);
    const double turn = 2.0 * std::numbers::pi * static_cast<double>(line) / kPeriod;
    // C_v |1 - e^{-j w Ts}|^2 / Ts^2, plus the edges of a period: n(t) is not periodic.
    const double expected =
        slope * (std::norm(1.0 - std::polar(1.0, -turn)) + 2.0 / kPeriod * std::cos(turn)) /
        (step * step);
    // 4000 draws of |.|^2, exponential: relative deviation 1/sqrt(4000) = 1.6 %; 5 sigma.
    EXPECT_NEAR(power / expected, 1.0, 0.08) << line;
  }
}

TEST(ClosedLoop, RefusesWhatDoesNotFit) {
  const RobotModel robot = robot_test::paper_robot();
  const LocalModel model = LocalModelBuilder(robot).build(robot_test::some_positions()[0]);
  const auto plant = local_plant(model, robot.sample_time);
  EXPECT_THROW((void)simulate_closed_loop(*plant, robot.controller, robot.sample_time,
                                          MatrixXd::Zero(5, 10), {}),
               InputError);
  EXPECT_THROW((void)simulate_closed_loop(*plant, robot.controller, robot.sample_time,
                                          MatrixXd::Zero(6, 10), {.periods = 0}),
               InputError);
}

// Small signals: the non-linear robot moves as its local model does, the more exactly the smaller.
TEST(RobotPlant, AgreesWithTheLocalModelForSmallSignals) {
  const RobotModel robot = robot_test::paper_robot();
  const VectorXd position = robot_test::some_positions()[3];
  const auto local = local_plant(LocalModelBuilder(robot).build(position), robot.sample_time);
  const auto full = robot_plant(robot, {}, position);
  double last = 1.0;
  for (const double rms : {0.5, 0.05}) {
    MultisineOptions options = six_inputs(400);
    options.rms = rms;
    const MatrixXd reference = Multisine(options, 4).reference(1);
    const ClosedLoopOptions loop{.settling_periods = 0, .periods = 1};
    const Recording linear =
        simulate_closed_loop(*local, robot.controller, robot.sample_time, reference, loop);
    const Recording nonlinear =
        simulate_closed_loop(*full, robot.controller, robot.sample_time, reference, loop);
    const double error = (linear.output - nonlinear.output).norm() / linear.output.norm();
    EXPECT_LT(error, 0.3 * last);  // non-linearity of order rms or higher
    last = error;
  }
  EXPECT_LT(last, 1e-3);
}

TEST(RobotPlant, DoesNotDependOnTheIntegratorsStep) {
  const RobotModel robot = robot_test::paper_robot();
  const VectorXd position = robot_test::some_positions()[4];
  const auto usual = robot_plant(robot, {}, position);
  const auto fine = robot_plant(robot, {}, position, {1e-11, 1e-13});
  MultisineOptions options = six_inputs(200);
  options.rms = 2.0;
  const MatrixXd reference = Multisine(options, 4).reference(2);
  const ClosedLoopOptions loop{.settling_periods = 0, .periods = 2};
  const Recording a =
      simulate_closed_loop(*usual, robot.controller, robot.sample_time, reference, loop);
  const Recording b =
      simulate_closed_loop(*fine, robot.controller, robot.sample_time, reference, loop);
  EXPECT_LT((a.output - b.output).norm(), 1e-6 * b.output.norm());
}

TEST(RobotPlant, StaysAtRest) {
  const RobotModel robot = robot_test::paper_robot();
  const auto plant = robot_plant(robot, {}, robot_test::some_positions()[2]);
  for (int t = 0; t < 200; ++t) plant->advance(VectorXd::Zero(6));
  EXPECT_LT(plant->output().norm(), 1e-6);
}

}  // namespace
}  // namespace graybox
