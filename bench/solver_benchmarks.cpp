// Benchmarks of the passes over a set and of every solver (google-benchmark). Wall time, one
// thread.
//
//   stream_read/Q     a plain sum of the set's array: what memory allows
//   pricing_pass/Q    w_i = tr(W H_i) for all candidates: one pass
//
//   solver_benchmarks --benchmark_filter='(stream_read|pricing_pass)/1000000'
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <cstdlib>
#include <vector>

#include "graybox/bench/benchmark_sets.hpp"
#include "graybox/problems/kernels/kernels.hpp"

namespace {

using graybox::InformationSet;
using graybox::bench::benchmark_set;

void set_byte_rate(benchmark::State& state, const InformationSet& set) {
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(set.bytes()));
}

void stream_read(benchmark::State& state, std::size_t count) {
  const InformationSet& set = benchmark_set("wis", count);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        graybox::kernels().sum(set.data(), set.candidate_count() * set.packed_size()));
  }
  set_byte_rate(state, set);
}

void pricing_pass(benchmark::State& state, std::size_t count) {
  const InformationSet& set = benchmark_set("wis", count);
  const std::vector<double> dual(set.packed_size(), 1.0);
  std::vector<double> prices(set.candidate_count());
  for (auto _ : state) {
    graybox::kernels().price(set.data(), set.candidate_count(), set.packed_size(), dual.data(),
                             prices.data());
    benchmark::DoNotOptimize(prices.data());
    benchmark::ClobberMemory();
  }
  set_byte_rate(state, set);
}

void register_passes() {
  for (const std::size_t count : {7920UL, 1'000'000UL}) {
    benchmark::RegisterBenchmark(fmt::format("stream_read/{}", count).c_str(), stream_read, count)
        ->UseRealTime();
    benchmark::RegisterBenchmark(fmt::format("pricing_pass/{}", count).c_str(), pricing_pass, count)
        ->UseRealTime();
  }
}

}  // namespace

int main(int argc, char** argv) {
  register_passes();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return EXIT_SUCCESS;
}
