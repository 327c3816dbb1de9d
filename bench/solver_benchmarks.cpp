// Benchmarks of the passes over a set and of every solver (google-benchmark), one thread. The
// column Time is wall time; rates are per second of processor time.
//
//   stream_read/Q        a plain sum of the set's array: what memory allows
//   pricing_pass/Q       w_i = tr(W H_i) for all candidates: one pass, on the robot's set
//   pricing_pass/FAMILY/Q  the same on another family
//   hessian_assembly/Q   sum_i s_i h_i h_i^T: the costly step of the dual interior point
//   SOLVER/Q             a solve on the robot's set (beyond 7920: a finer grid)
//   constrained/rows:M/Q 20 experiments on the robot's set under M random rows (none: the plain
//                        problem by the same code), gap 1e-9; compare with column_generation/Q
//   SOLVER/FAMILY/Q      the same on another family (problems/families); a curve of another
//                        dimension than its default is named FAMILY_D (legendre_31), a set in
//                        factor form FAMILY_factors: a pass then reads factors
//
// Counters of a solve: asked_gap, what it was asked for; gap, what the checker found; solved, 1 if
// that is enough; passes over the set; iterations; bytes/s of the set read; pass_times, the median
// solve over the median pricing pass of the same run, both measured in turn, processor time;
// peak_memory_bytes of the process so far, which never falls: compare it only between processes
// that run one benchmark. Each solve of column_generation has another seed; counters other than
// pass_times are those of the last.
//
// Sets are made on first use, so a filter saves their time; at most one large set is in memory:
//   solver_benchmarks --benchmark_filter='(stream_read|pricing_pass|column_generation)/7920'
//   solver_benchmarks --benchmark_filter='/1000000' --benchmark_repetitions=9
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include "bench/benchmark_sets.hpp"
#include "bench/pin_threads.hpp"
#include "bench/study/plan.hpp"
#include "bench/study/study_sets.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/kernels/factor_kernels.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/constrained/constrained_certificate.hpp"
#include "solvers/constrained/constrained_column_generation.hpp"
#include "solvers/interior_point/hessian_assembly.hpp"
#include "solvers/registry.hpp"
#include "solvers/report/solve_report.hpp"

namespace {

using graybox::InformationSet;
using graybox::Solver;
using graybox::bench::benchmark_set;
using graybox::bench::kFullSize;

constexpr std::size_t kHundredThousand = 100'000;
constexpr std::size_t kMillion = 1'000'000;
constexpr std::size_t kQuadraticLimit = 1000;  // largest Q for solvers whose memory grows as Q^2
constexpr double kConstrainedGap = 1e-9;
constexpr double kTimeLimit = 60.0;  // seconds a solve

void set_byte_rate(benchmark::State& state, const InformationSet& set, double passes) {
  const double bytes = passes * static_cast<double>(set.bytes());
  state.SetBytesProcessed(
      static_cast<std::int64_t>(bytes * static_cast<double>(state.iterations())));
}

void stream_read(benchmark::State& state, std::size_t count) {
  const InformationSet& set = benchmark_set("robot", count);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        graybox::kernels().sum(set.data(), set.candidate_count() * set.packed_size()));
  }
  set_byte_rate(state, set, 1.0);
}

// One pass over a set, in the form that it holds.
class PricingPass {
 public:
  explicit PricingPass(const InformationSet& set)
      : set_(set),
        numbers_(set.packed_size(), 1.0),
        scratch_(graybox::factor_kernels().scratch_size(set.dimension())),
        prices_(set.candidate_count()) {}

  void run() {
    if (set_.has_factors()) {
      graybox::factor_kernels().price(set_.factors(), set_.candidate_count(), set_.rank(),
                                      set_.dimension(), numbers_.data(), scratch_.data(),
                                      prices_.data());
    } else {
      graybox::kernels().price(set_.data(), set_.candidate_count(), set_.packed_size(),
                               numbers_.data(), prices_.data());
    }
    benchmark::DoNotOptimize(prices_.data());
    benchmark::ClobberMemory();
  }

 private:
  const InformationSet& set_;
  std::vector<double> numbers_, scratch_, prices_;
};

void pricing_pass(benchmark::State& state, const std::string& family, std::size_t count) {
  const InformationSet& set = benchmark_set(family, count);
  PricingPass pass(set);
  for (auto _ : state) pass.run();
  set_byte_rate(state, set, 1.0);
}

double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// Solves and pricing passes of one run, in turn.
class PassTimes {
 public:
  explicit PassTimes(const InformationSet& set)
      : numbers_(set.bytes() / sizeof(double)), pass_(set) {}

  void add_solve(double seconds) { solves_.push_back(seconds); }
  void add_pass() {
    // Small sets are read a few times over, so that the clock's own time does not matter.
    const std::size_t times = 1 + kValues / numbers_;
    const double before = processor_seconds();
    for (std::size_t k = 0; k < times; ++k) pass_.run();
    passes_.push_back((processor_seconds() - before) / static_cast<double>(times));
  }
  [[nodiscard]] double ratio() const { return median(solves_) / median(passes_); }

 private:
  static constexpr std::size_t kValues = 1'000'000;
  std::size_t numbers_;
  PricingPass pass_;
  std::vector<double> solves_, passes_;
};

void hessian_assembly(benchmark::State& state, std::size_t count) {
  const InformationSet& set = benchmark_set("robot", count);
  const std::size_t p = set.packed_size();
  graybox::HessianAssembly assembly(p, 1);
  const std::vector<double> scales(set.candidate_count(), 0.5);
  std::vector<double> gram(p * p);
  for (auto _ : state) {
    assembly.assemble(set.data(), set.candidate_count(), scales, gram);
    benchmark::DoNotOptimize(gram.data());
    benchmark::ClobberMemory();
  }
  set_byte_rate(state, set, 1.0);
}

void solve(benchmark::State& state, const Solver& solver, const std::string& family,
           std::size_t count, double gap) {
  const InformationSet& set = benchmark_set(family, count);
  graybox::SolveOptions options{.duality_gap = gap, .time_limit = kTimeLimit};
  graybox::Solution solution;
  PassTimes times(set);
  options.seed = 0;
  for (auto _ : state) {
    ++options.seed;
    const double before = processor_seconds();
    solution = solver.solve(set, options);
    const double after = processor_seconds();
    state.PauseTiming();
    times.add_solve(after - before);
    times.add_pass();
    state.ResumeTiming();
  }
  const graybox::SolveReport report = graybox::judge(set, solver.name(), options, solution);
  const bool solved = report.status == graybox::ReportStatus::kSolved;
  if (!solved) state.SetLabel(std::string(to_string(report.status)));
  state.counters["asked_gap"] = gap;
  state.counters["gap"] = report.certificate.duality_gap;
  state.counters["solved"] = solved ? 1.0 : 0.0;
  state.counters["passes"] = report.counters.passes;
  state.counters["pass_times"] = times.ratio();
  state.counters["iterations"] = static_cast<double>(report.counters.iterations);
  state.counters["peak_memory_bytes"] = static_cast<double>(report.peak_memory_bytes);
  set_byte_rate(state, set, report.counters.passes);
}

// The gaps of the targets: the best method to the tightest.
double benchmark_gap(const std::string& solver) {
  if (solver == "column_generation") return 1e-9;
  if (solver == "dual_interior_point") return 1e-8;
  return 1e-6;
}

void register_solve(const Solver& solver, const std::string& family, std::size_t count) {
  const std::string name(solver.name());
  const std::string middle = family == "robot" ? "" : "/" + family;
  benchmark::RegisterBenchmark(
      fmt::format("{}{}/{}", name, middle, count).c_str(),
      [&solver, family, count, gap = benchmark_gap(name)](benchmark::State& state) {
        solve(state, solver, family, count, gap);
      })

      ->Unit(benchmark::kMillisecond);
}

// At most 45 % of what the rows allow at most, so that most of them bind.
graybox::DesignConstraints random_rows(const InformationSet& set, std::size_t rows) {
  constexpr double kExperiments = 20.0, kShare = 0.45;
  graybox::DesignConstraints constraints = graybox::number_of_experiments(set, kExperiments);
  graybox::Random random(1);
  for (std::size_t j = 0; j < rows; ++j) {
    std::vector<double> coefficients(set.candidate_count());
    for (double& a : coefficients) a = random.uniform();
    constraints.rows.push_back({.name = fmt::format("row {}", j),
                                .coefficients = std::move(coefficients),
                                .upper = kShare * kExperiments});
  }
  return constraints;
}

void constrained(benchmark::State& state, std::size_t rows, std::size_t count) {
  const InformationSet& set = benchmark_set("robot", count);
  const graybox::DesignConstraints constraints = random_rows(set, rows);
  graybox::SolveOptions options;
  options.duality_gap = kConstrainedGap;
  graybox::ConstrainedSolution solution;
  for (auto _ : state) solution = graybox::solve_constrained(set, constraints, options);
  const graybox::Certificate proof =
      graybox::certify_constrained(set, solution.efforts, constraints, {}, kConstrainedGap)
          .certificate;
  state.counters["gap"] = proof.duality_gap;
  state.counters["solved"] = graybox::proves(proof, kConstrainedGap) ? 1 : 0;
  state.counters["passes"] = solution.counters.passes;
}

void register_constrained() {
  for (const std::size_t rows : {0U, 1U, 10U, 30U}) {
    benchmark::RegisterBenchmark(fmt::format("constrained/rows:{}/{}", rows, kFullSize).c_str(),
                                 constrained, rows, kFullSize)
        ->Unit(benchmark::kMillisecond);
  }
}

void register_pass(const std::string& family, std::size_t count) {
  const std::string middle = family == "robot" ? "" : "/" + family;
  benchmark::RegisterBenchmark(fmt::format("pricing_pass{}/{}", middle, count).c_str(),
                               pricing_pass, family, count);
}

void register_passes(std::size_t count) {
  benchmark::RegisterBenchmark(fmt::format("stream_read/{}", count).c_str(), stream_read, count);
  register_pass("robot", count);
}

void register_solver(const Solver& solver) {
  const bool quadratic = solver.traits().memory_exponent > 1;
  for (const std::size_t count :
       graybox::bench::study_sizes(quadratic ? kQuadraticLimit : kFullSize)) {
    register_solve(solver, "robot", count);
  }
  if (quadratic) return;
  for (const std::string& family : graybox::bench::study_families().whole) {
    register_solve(solver, family, kFullSize);
  }
}

// A pass and a solve on one set, before the next is made.
void register_pair(const Solver& column_generation, const std::string& family, std::size_t count) {
  register_pass(family, count);
  register_solve(column_generation, family, count);
}

// Smooth curves on grids of 1e3 to 1e5, up to polynomials of degree 30.
void register_curves(const Solver& column_generation) {
  for (const std::size_t count : {std::size_t{1000}, std::size_t{10'000}, kHundredThousand}) {
    for (const char* family : {"legendre", "legendre_20", "legendre_31", "chebyshev", "monomials",
                               "splines", "splines_31", "exponentials"}) {
      register_pair(column_generation, family, count);
    }
  }
}

void register_hundred_thousand(const Solver& column_generation) {
  for (const char* family : {"rob", "wis", "flat", "smo", "smr6", "r1g", "r1l"}) {
    register_pair(column_generation, family, kHundredThousand);
  }
}

void register_million(const Solver& column_generation) {
  register_passes(kMillion);
  register_solve(column_generation, "robot", kMillion);
  for (const char* family : {"rob", "wis", "flat", "smo", "smr6", "r1g", "r1g_factors"}) {
    register_pair(column_generation, family, kMillion);
  }
}

int run(int argc, char** argv) {
  const graybox::SolverRegistry registry = graybox::make_registry();
  for (const std::size_t count : {std::size_t{2000}, std::size_t{4000}, kFullSize}) {
    register_passes(count);
    benchmark::RegisterBenchmark(fmt::format("hessian_assembly/{}", count).c_str(),
                                 hessian_assembly, count);
  }
  for (const auto& entry : registry.entries()) {
    if (entry.solver != nullptr) register_solver(*entry.solver);
  }
  for (const std::string& family : graybox::bench::study_families().whole) {
    register_pass(family, kFullSize);
  }
  register_curves(registry.at("column_generation"));
  register_hundred_thousand(registry.at("column_generation"));
  register_million(registry.at("column_generation"));
  register_constrained();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return EXIT_SUCCESS;
}

}  // namespace

int main(int argc, char** argv) {
  graybox::bench::pin_threads(1, argv);
  try {
    return run(argc, argv);
  } catch (const graybox::InputError& error) {
    std::fprintf(stderr, "solver_benchmarks: %s\n", error.what());
    return 2;
  }
}
