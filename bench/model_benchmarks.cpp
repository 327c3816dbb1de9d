// Benchmarks of the robot's model (google-benchmark). Wall time.
//
//   information_matrices/Q    the information matrices of Q positions: static equilibrium, mass
//                             matrix, 50 frequencies, packed set. 7920 is the paper's grid, more
//                             come from a refined one.
//   linearisation/Q           of that, the equilibrium and mass matrix alone, one thread
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
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <numbers>
#include <string>
#include <string_view>
#include <thread>

#include "graybox/problems/local_model.hpp"
#include "graybox/problems/robot_grid.hpp"
#include "graybox/problems/robot_information.hpp"
#include "graybox/problems/robot_model.hpp"

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

// Takes --threads=N out of the arguments; 0 if N is no number from 1 on.
int take_thread_count(int& argc, char** argv) {
  constexpr std::string_view kFlag = "--threads=";
  int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  int kept = 1;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (!argument.starts_with(kFlag)) {
      argv[kept++] = argv[i];
      continue;
    }
    const std::string_view value = argument.substr(kFlag.size());
    threads = 0;
    std::from_chars(value.data(), value.data() + value.size(), threads);
  }
  argc = kept;
  return threads;
}

}  // namespace

int main(int argc, char** argv) {
  const int threads = take_thread_count(argc, argv);
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
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
