// Benchmarks of the robot's model (google-benchmark). Wall time.
//
//   information_matrices/Q    the information matrices of Q positions: static equilibrium, mass
//                             matrix, 50 frequencies, packed set. 7920 is the paper's grid, more
//                             come from a refined one.
//   linearisation/Q           of that, the equilibrium and mass matrix alone, one thread
//   mass_and_bias/graybox, /kdl   mass matrix, Coriolis and gravity torques of the arm, once
//   equations_of_motion       accelerations of the non-linear robot, once
//   plant_sample/local, /robot    one simulated sample under the controller, with noise
//   frequency_responses/15    15 positions x 50 lines x 36 channels from 90 recordings of 8 s at 2
//   kHz
//                             (HDF5, 18 channels each), reading included; /15/csv: from CSV
//   fit/15                    the 12 stiffnesses from those responses, start off by up to 3 either
//   way
//
// Counters: set_bytes, the packed set; peak_bytes, the most memory the process had in use while it
// made the set, beyond what it used before (the set included); peak_over_set, their ratio;
// positions/s; threads.
//
//   model_benchmarks --threads=2 --benchmark_filter=information_matrices/7920
// --threads=N: all processors if absent.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "bench/benchmark_folder.hpp"
#include "bench/thread_argument.hpp"
#include "diagnosis/response_fits/maximum_likelihood.hpp"
#include "diagnosis/responses/estimate_responses.hpp"
#include "diagnosis/signals/multisine.hpp"
#include "diagnosis/simulation/closed_loop.hpp"
#include "diagnosis/simulation/excitation_plan.hpp"
#include "diagnosis/simulation/plant.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "problems/mechanisms/chain_dynamics.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/robot_dynamics.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/mechanisms/robot_rest.hpp"
#include "problems/robot_information/robot_grid.hpp"
#include "problems/robot_information/robot_information.hpp"

namespace {

// A field of /proc/self/status, in bytes; 0 where the system does not tell.
double process_memory(std::string_view field) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(field) && line.size() > field.size() && line[field.size()] == ':') {
      return 1024.0 * std::strtod(line.c_str() + field.size() + 1, nullptr);
    }
  }
  return 0.0;
}

// Lowers the recorded peak to the memory in use now.
void reset_peak_memory() { std::ofstream("/proc/self/clear_refs") << "5"; }

void information_matrices(benchmark::State& state, std::size_t count, int threads) {
  const graybox::RobotModel robot = graybox::load_robot_model(graybox::default_robot_file());
  const graybox::PositionTable positions = graybox::robot_grid(count);
  double set_bytes = 0.0, peak_bytes = 0.0;
  for (auto _ : state) {
    state.PauseTiming();
    reset_peak_memory();
    const double before = process_memory("VmRSS");
    state.ResumeTiming();
    const graybox::InformationSet set =
        graybox::robot_information_set(robot, positions, {.threads = threads});
    benchmark::DoNotOptimize(set.data());
    state.PauseTiming();
    set_bytes = static_cast<double>(set.bytes());
    peak_bytes = std::max(peak_bytes, process_memory("VmHWM") - before);
    state.ResumeTiming();
  }
  state.counters["set_bytes"] = set_bytes;
  state.counters["peak_bytes"] = peak_bytes;
  state.counters["peak_over_set"] = peak_bytes / set_bytes;
  state.counters["threads"] = threads;
  state.counters["positions/s"] =
      benchmark::Counter(static_cast<double>(count), benchmark::Counter::kIsIterationInvariantRate);
}

void linearisation(benchmark::State& state, std::size_t count) {
  const graybox::RobotModel robot = graybox::load_robot_model(graybox::default_robot_file());
  const graybox::PositionTable positions = graybox::robot_grid(count);
  graybox::LocalModelBuilder builder(robot);
  Eigen::VectorXd angles(robot.motor_count());
  for (auto _ : state) {
    for (std::size_t i = 0; i < positions.count(); ++i) {
      std::ranges::transform(positions.position(i), angles.begin(),
                             [](double degrees) { return degrees * std::numbers::pi / 180.0; });
      benchmark::DoNotOptimize(builder.linearise(angles).mass.data());
    }
  }
  state.counters["positions/s"] =
      benchmark::Counter(static_cast<double>(count), benchmark::Counter::kIsIterationInvariantRate);
}

// The robot at rest at one position, moving slowly.
struct MovingRobot {
  graybox::RobotModel robot = graybox::load_robot_model(graybox::default_robot_file());
  Eigen::VectorXd angles = Eigen::VectorXd::Constant(robot.motor_count(), 0.3);
  graybox::RobotRest rest = graybox::robot_rest(robot, {}, angles);
  Eigen::VectorXd velocity = Eigen::VectorXd::Constant(rest.coordinates.size(), 0.01);
};

void mass_and_bias(benchmark::State& state) {
  const MovingRobot at;
  graybox::ChainDynamics dynamics(at.robot.chain);
  const Eigen::Index n = at.robot.arm_size();
  const Eigen::VectorXd q = at.rest.coordinates.head(n), velocity = at.velocity.head(n);
  for (auto _ : state) {
    dynamics.evaluate(q, velocity);
    benchmark::DoNotOptimize(dynamics.bias().data());
  }
}

void mass_and_bias_kdl(benchmark::State& state) {
  const MovingRobot at;
  graybox::RigidChainEvaluator kdl(at.robot.chain);
  const Eigen::Index n = at.robot.arm_size();
  const Eigen::VectorXd q = at.rest.coordinates.head(n), velocity = at.velocity.head(n);
  for (auto _ : state) {
    benchmark::DoNotOptimize(kdl.mass_matrix(q).data());
    benchmark::DoNotOptimize(kdl.coriolis_torque(q, velocity).data());
    benchmark::DoNotOptimize(kdl.gravity_torque(q).data());
  }
}

void equations_of_motion(benchmark::State& state) {
  const MovingRobot at;
  graybox::RobotDynamics dynamics(at.robot);
  const Eigen::VectorXd no_force = Eigen::VectorXd::Zero(at.velocity.size());
  Eigen::VectorXd acceleration(at.velocity.size());
  for (auto _ : state) {
    dynamics.accelerate(at.rest.coordinates, at.velocity, at.rest.holding_torque, no_force,
                        acceleration);
    benchmark::DoNotOptimize(acceleration.data());
  }
}

// Many samples in a row; `sample` is the time of one.
void plant_sample(benchmark::State& state, bool is_local) {
  const MovingRobot at;
  const auto plant = is_local ? graybox::local_robot_plant(at.robot, {}, at.angles)
                              : graybox::robot_plant(at.robot, {}, at.angles);
  const graybox::Multisine signal({.period = 8000,
                                   .lines = {5, 21, 45, 101, 201, 401},
                                   .relative_amplitude = {},
                                   .inputs = at.robot.motor_count(),
                                   .rms = 1.0},
                                  1);
  const graybox::ClosedLoopOptions loop{
      .settling_periods = 0, .periods = 1, .noise_psd_slope = 1e-12};
  for (auto _ : state) {
    const graybox::Recording recording = graybox::simulate_closed_loop(
        *plant, at.robot.controller, at.robot.sample_time, signal.reference(0), loop);
    benchmark::DoNotOptimize(recording.output.data());
  }
  state.counters["sample"] = benchmark::Counter(
      8000.0, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

// A simulated campaign in a folder of its own, removed in the end: the positions of Table I.
class TemporaryCampaign {
 public:
  TemporaryCampaign(graybox::ExcitationPlan::DataFormat data, int threads) {
    const auto system = graybox::load_system(graybox::default_robot_file());
    graybox::ExcitationPlan plan;
    plan.levels = {1.0};
    plan.period = 8000;
    plan.noise_psd_slope = 1e-12;
    plan.data = data;
    for (const auto& angles : kTableOne) {
      plan.positions.push_back(Eigen::Map<const Eigen::Matrix<double, 6, 1>>(angles.data()));
    }
    std::vector<double> hertz;
    for (int k = 0; k < 50; ++k) hertz.push_back(1.25 + 1.25 * k);
    plan.lines = graybox::odd_lines(hertz, plan.period, system.sample_time);
    graybox::SimulationOptions options;
    options.threads = threads;
    (void)graybox::simulate_campaign(system, plan, folder_.file("campaign"), options);
  }
  [[nodiscard]] std::vector<graybox::FrequencyResponseEstimate> estimate(int threads) const {
    const graybox::Campaign campaign = graybox::read_campaign(folder_.file("campaign"));
    graybox::ResponseOptions options;
    options.threads = threads;
    return graybox::estimate_responses(campaign, options);
  }

 private:
  static constexpr std::array<std::array<double, 6>, 15> kTableOne{{{0, -60, 45, 45, -90, 0},
                                                                    {0, -15, -150, 45, 90, 0},
                                                                    {0, 15, -105, 0, -45, 0},
                                                                    {45, -60, -45, 90, -90, 0},
                                                                    {45, -45, 0, 45, 0, 0},
                                                                    {45, -30, -75, 0, 0, 0},
                                                                    {45, -30, 45, 0, -45, 0},
                                                                    {45, -15, -45, 45, -90, 0},
                                                                    {45, -15, -30, 0, -90, 0},
                                                                    {45, 0, -75, 90, -90, 0},
                                                                    {45, 15, -165, 45, 0, 0},
                                                                    {45, 15, -150, 0, -90, 0},
                                                                    {45, 75, 15, 90, 0, 0},
                                                                    {45, 75, 30, 90, 0, 0},
                                                                    {90, 75, 60, 0, -45, 0}}};
  graybox::BenchmarkFolder folder_;
};

void frequency_responses(benchmark::State& state, graybox::ExcitationPlan::DataFormat data,
                         int threads) {
  const TemporaryCampaign campaign(data, threads);
  for (auto _ : state) {
    const auto estimates = campaign.estimate(threads);
    benchmark::DoNotOptimize(estimates.data());
  }
  state.counters["threads"] = threads;
}

void fit(benchmark::State& state, int threads) {
  const graybox::RobotModel robot = graybox::load_robot_model(graybox::default_robot_file());
  const graybox::RobotResponseModel model(robot);
  const TemporaryCampaign campaign(graybox::ExcitationPlan::DataFormat::kHdf5, threads);
  std::vector<graybox::ResponseMeasurement> measurements;
  for (const auto& estimate : campaign.estimate(threads)) {
    measurements.push_back(graybox::response_measurement(estimate));
  }
  Eigen::VectorXd start(static_cast<Eigen::Index>(model.parameter_names().size()));
  for (Eigen::Index p = 0; p < start.size(); ++p) start(p) = p % 2 == 0 ? 1.5 : 1.0 / 1.5;
  graybox::FitOptions options;
  options.threads = threads;
  double error = 0.0;
  for (auto _ : state) {
    const graybox::FitResult result =
        graybox::fit_maximum_likelihood(model, measurements, start, options);
    error = result.status == graybox::FitStatus::kConverged
                ? (result.theta.array() - 1.0).abs().maxCoeff()
                : std::numeric_limits<double>::quiet_NaN();
  }
  state.counters["largest_error"] = error;
  state.counters["threads"] = threads;
}

}  // namespace

int main(int argc, char** argv) {
  const int threads = graybox::bench::take_thread_count(argc, argv);
  if (threads < 1) {
    std::fputs("--threads: must be a number from 1 on\n", stderr);
    return 2;
  }
  for (const std::size_t count : {1000UL, 7920UL, 100'000UL}) {
    benchmark::RegisterBenchmark(fmt::format("information_matrices/{}", count).c_str(),
                                 information_matrices, count, threads)
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::RegisterBenchmark("linearisation/7920", linearisation, 7920UL)
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("mass_and_bias/graybox", mass_and_bias);
  benchmark::RegisterBenchmark("mass_and_bias/kdl", mass_and_bias_kdl);
  benchmark::RegisterBenchmark("equations_of_motion", equations_of_motion);
  for (const bool is_local : {true, false}) {
    benchmark::RegisterBenchmark(is_local ? "plant_sample/local" : "plant_sample/robot",
                                 plant_sample, is_local)
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::RegisterBenchmark("frequency_responses/15", frequency_responses,
                               graybox::ExcitationPlan::DataFormat::kHdf5, threads)
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
  benchmark::RegisterBenchmark("frequency_responses/15/csv", frequency_responses,
                               graybox::ExcitationPlan::DataFormat::kCsv, threads)
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
  benchmark::RegisterBenchmark("fit/15", fit, threads)
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
