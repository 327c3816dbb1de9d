// Benchmarks of the diagnosis (google-benchmark). Wall time.
//
//   preparation/P   from recordings to the fitted model as it is: reading, first fit, transients
//   ranking/P       score tests of all hypotheses, with 199 draws of noise
//   verdict/P       the whole search, from a prepared problem
//
// The full robot in P positions of its grid, 2 levels, 50 excited lines, six sub-experiments each,
// with a gearbox that hardens, simulated with all non-linear equations. Each is run once.
//
//   diagnosis_benchmarks --threads=2 --benchmark_filter=/15
// --threads=N: all processors if absent.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <Eigen/Core>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "bench/benchmark_folder.hpp"
#include "bench/thread_argument.hpp"
#include "diagnosis/periodic/periodic_mismatch.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/signals/multisine.hpp"
#include "diagnosis/simulation/excitation_plan.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"

namespace {

constexpr const char* kHidden = R"(format: graybox-physics/1
elements:
  - name: hidden
    location: {kind: element, joint: joint_3, axis: gearbox}
    law: cubic_spring
    parameters: {stiffness: {value: 5.0e+11, unit: N m/rad^3}}
)";

class HardeningRobot {
 public:
  HardeningRobot(std::size_t positions, int threads) {
    std::ofstream(folder_.file("hidden.yaml")) << kHidden;
    const auto system =
        graybox::load_system(graybox::default_robot_file(), folder_.file("hidden.yaml"));
    graybox::ExcitationPlan plan;
    plan.plant = graybox::SimulatedSystem::PlantKind::kRobot;
    plan.levels = {2.0, 8.0};
    plan.period = 2000;
    plan.noise_psd_slope = 1e-11;
    const graybox::PositionTable grid = graybox::paper_grid();
    for (std::size_t p = 0; p < positions; ++p) {
      const auto degrees = grid.position((2 * p + 1) * grid.count() / (2 * positions));
      plan.positions.emplace_back(Eigen::Map<const Eigen::VectorXd>(
          degrees.data(), static_cast<Eigen::Index>(degrees.size())));
    }
    std::vector<double> hertz;
    for (int k = 0; k < 50; ++k) hertz.push_back(1.0 + 2.0 * k);
    plan.lines = graybox::odd_lines(hertz, plan.period, system.sample_time);
    graybox::SimulationOptions options;
    options.threads = threads;
    (void)graybox::simulate_campaign(system, plan, folder_.file("campaign"), options);
  }

  [[nodiscard]] std::unique_ptr<graybox::MismatchProblem> problem(int threads) const {
    graybox::PeriodicMismatchOptions options;
    options.threads = threads;
    return graybox::periodic_mismatch_problem(
        graybox::default_robot_file(), graybox::read_campaign(folder_.file("campaign")), options);
  }

 private:
  graybox::BenchmarkFolder folder_;
};

// Simulated once for all benchmarks of as many positions.
const HardeningRobot& robot_in(std::size_t positions, int threads) {
  static std::map<std::size_t, std::unique_ptr<HardeningRobot>> robots;
  auto& robot = robots[positions];
  if (!robot) robot = std::make_unique<HardeningRobot>(positions, threads);
  return *robot;
}

void preparation(benchmark::State& state, std::size_t positions, int threads) {
  const HardeningRobot& robot = robot_in(positions, threads);
  for (auto _ : state) {
    const auto problem = robot.problem(threads);
    benchmark::DoNotOptimize(problem->fit({}, nullptr).deviance);
  }
  state.counters["threads"] = threads;
}

void ranking(benchmark::State& state, std::size_t positions, int threads) {
  const auto problem = robot_in(positions, threads).problem(threads);
  const graybox::ExtendedFit fit = problem->fit({}, nullptr);
  std::vector<std::size_t> all(problem->hypotheses().size());
  std::iota(all.begin(), all.end(), 0UL);
  std::erase_if(all, [&](std::size_t i) { return problem->hypotheses()[i].only_named; });
  for (auto _ : state) {
    benchmark::DoNotOptimize(problem->scores(fit, all, 199, 1).scores.data());
  }
  state.counters["hypotheses"] = static_cast<double>(all.size());
  state.counters["threads"] = threads;
}

void verdict(benchmark::State& state, std::size_t positions, int threads) {
  const auto problem = robot_in(positions, threads).problem(threads);
  graybox::Diagnosis diagnosis;
  for (auto _ : state) diagnosis = graybox::diagnose(*problem);
  state.counters["effects"] = static_cast<double>(diagnosis.effects.size());
  state.counters["chi2_per_dof"] = diagnosis.after.estimation.chi_square_per_dof();
  state.counters["threads"] = threads;
  if (!diagnosis.effects.empty()) {
    const graybox::Hypothesis& found =
        problem->hypotheses()[diagnosis.effects.front().law.hypothesis];
    state.SetLabel(
        fmt::format("{}: {} at {}", graybox::to_string(diagnosis.verdict), found.law, found.place));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int threads = graybox::bench::take_thread_count(argc, argv);
  if (threads < 1) {
    std::fputs("--threads: must be a number from 1 on\n", stderr);
    return 2;
  }
  for (const std::size_t positions : {1UL, 3UL, 15UL}) {
    const auto add = [&](const char* name, auto* function) {
      benchmark::RegisterBenchmark(fmt::format("{}/{}", name, positions).c_str(), function,
                                   positions, threads)
          ->Unit(benchmark::kSecond)
          ->Iterations(1)
          ->UseRealTime();
    };
    add("preparation", preparation);
    add("ranking", ranking);
    add("verdict", verdict);
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
