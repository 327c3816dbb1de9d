#include "solvers/column_generation/fallback.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <utility>
#include <vector>

#include "problems/base/available_memory.hpp"
#include "problems/base/stop.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/core/sensitivity_error.hpp"
#include "solvers/exchange/vertex_exchange.hpp"
#include "solvers/interior_point/dual_interior_point.hpp"
#include "solvers/pricing/candidate_pool.hpp"

namespace graybox {
namespace {

// Hands the progress of a second method on to the clock of the first.
class ContinuedTrace final : public SolveObserver {
 public:
  ContinuedTrace(Tracer& tracer, std::int64_t iterations_before)
      : tracer_(tracer), iterations_before_(iterations_before) {}

  bool on_progress(const TracePoint& point) override {
    count_up_to(point.passes);
    tracer_.record(point.duality_gap, iterations_before_ + point.iteration);
    return !tracer_.out_of_time();
  }
  void count_up_to(double passes) {
    tracer_.count_passes(passes - counted_);
    counted_ = passes;
  }

 private:
  Tracer& tracer_;
  std::int64_t iterations_before_;
  double counted_ = 0.0;
};

// The gap of a finished method's design and what rounding may hide of it. One pass and the support.
void price(const InformationSet& set, const SolveOptions& options, Tracer& tracer,
           MethodOutcome& outcome) {
  outcome.gap = std::numeric_limits<double>::infinity();
  std::vector<double> matrix(set.packed_size());
  information_matrix(set, outcome.design.weights, matrix);
  InverseCholesky inverse(set.dimension());
  if (!inverse.factor(matrix)) return;
  CandidatePool all;
  all.count = set.candidate_count();
  all.sensitivity = AlignedArray(all.count);
  price_pool(set, inverse, options.threads, all);
  tracer.count_passes(1.0);
  const auto support =
      std::ranges::count_if(outcome.design.weights, [](double w) { return w > 0; });
  outcome.gap = all.largest() / static_cast<double>(set.dimension()) - 1.0;
  outcome.gap_error = sensitivity_error(matrix, inverse.trace_dual(), set.dimension(),
                                        static_cast<std::size_t>(support));
  tracer.record(outcome.gap, outcome.iterations);
}

MethodOutcome run(const Solver& solver, const InformationSet& set, SolveOptions options,
                  std::int64_t iterations_before, Tracer& tracer) {
  options.time_limit = std::max(1e-6, options.time_limit - tracer.seconds());
  options.iteration_limit = 0;
  ContinuedTrace progress(tracer, iterations_before);
  Solution solution = solver.solve(set, options, &progress);
  progress.count_up_to(solution.counters.passes);
  MethodOutcome outcome{std::move(solution.design),
                        solution.status,
                        std::numeric_limits<double>::infinity(),
                        0.0,
                        iterations_before + solution.counters.iterations,
                        std::move(solution.message)};
  if (!outcome.design.weights.empty()) price(set, options, tracer, outcome);
  if (outcome.gap + outcome.gap_error <= options.duality_gap) {
    outcome.status = SolveStatus::kSolved;
  } else if (outcome.status == SolveStatus::kSolved) {
    outcome.status = SolveStatus::kNumericalFailure;
  }
  return outcome;
}

// Whether the matrices of a set in factor form are there, or could be made in memory and time.
bool has_or_makes_matrices(const InformationSet& set) {
  if (set.has_matrices()) return true;
  const std::size_t bytes = set.candidate_count() * set.packed_size() * sizeof(double);
  if (bytes >= available_memory()) return false;
  try {
    static_cast<void>(set.data());
  } catch (const Stopped&) {
    return false;
  }
  return true;
}

}  // namespace

MethodOutcome finish_with_another(const InformationSet& set, const SolveOptions& options,
                                  std::string_view name, MethodOutcome stopped, Tracer& tracer) {
  // Where the gap is reached, but for rounding, no other method in double precision knows better,
  // nor where rounding hides more than the gap asked for and what is left of it.
  if (stopped.gap <= options.duality_gap) return stopped;
  if (stopped.gap_error >= std::max(stopped.gap, options.duality_gap)) return stopped;
  const std::string stop = std::isfinite(stopped.gap)
                               ? fmt::format("{} stopped at gap {:.1e}", name, stopped.gap)
                               : fmt::format("{} found no start", name);
  if (!has_or_makes_matrices(set)) {
    if (tracer.out_of_time() && !stopped.design.weights.empty()) {
      stopped.status = SolveStatus::kTimeLimit;
    }
    stopped.message += "; the methods that might go on work on matrices, not on factors";
    return stopped;
  }
  const DualInteriorPoint dual;
  const VertexExchange exchange;
  for (const Solver* solver : std::initializer_list<const Solver*>{&dual, &exchange}) {
    if (tracer.out_of_time()) break;
    MethodOutcome outcome = run(*solver, set, options, stopped.iterations, tracer);
    if (outcome.status == SolveStatus::kSolved) {
      outcome.message = fmt::format("finished by {} after {}", solver->name(), stop);
      return outcome;
    }
    if (outcome.gap < stopped.gap) {
      outcome.message = fmt::format("{}; {} went on to {:.1e}", stop, solver->name(), outcome.gap);
      stopped = std::move(outcome);
    } else {
      stopped.iterations = outcome.iterations;
    }
  }
  if (!stopped.design.weights.empty()) {
    stopped.status =
        tracer.out_of_time() ? SolveStatus::kTimeLimit : SolveStatus::kNumericalFailure;
    if (stopped.gap <= stopped.gap_error) {
      stopped.message += fmt::format("; rounding hides up to {:.1e} of it", stopped.gap_error);
    }
  }
  return stopped;
}

}  // namespace graybox
