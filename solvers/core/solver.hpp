// Solver: the interface of every back-end for optimal design,
//
//   minimise  log det (sum_i lambda_i H_i)^-1   subject to  lambda >= 0, sum_i lambda_i = 1
//
// (paper, formula (9); its dual is formula (10)), or another criterion of criterion.hpp in place of
// log det.
//
//   const graybox::SolverRegistry registry = graybox::make_registry();
//   const graybox::Solver& solver = registry.at("column_generation");
//   const graybox::Solution answer = solver.solve(set, {.duality_gap = 1e-9});
//   const graybox::Certificate proof = graybox::certify(set, answer.design);  // trust only this
//   assert(proof.duality_gap <= 1e-9);
//
// A solver stops as soon as its own figure for the duality gap (for D, max_i tr(M^-1 H_i)/d - 1;
// for each criterion as certificate.hpp has it) is at most options.duality_gap. What counts as
// solved is decided by certify() (certificate.hpp), never by the solver. Bad problems throw
// InputError; everything numerical is a status.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/core/design.hpp"
#include "solvers/core/weight_repair.hpp"

namespace graybox {

// Zero is success; negative values are outcomes short of it. On every status but `unsupported` the
// returned design is the best the solver had: weights on the simplex, never empty.
enum class SolveStatus : std::int8_t {
  kSolved = 0,             // the solver's own gap reached options.duality_gap
  kIterationLimit = -1,    // options.iteration_limit iterations were not enough
  kTimeLimit = -2,         // options.time_limit passed, or the observer asked to stop
  kNumericalFailure = -3,  // no further progress in double precision; `message` says what happened
  kUnsupported = -4,       // this back-end can't take this problem; `message` says why; no design
};
[[nodiscard]] std::string_view to_string(SolveStatus status);  // "solved", "iteration_limit", ...

struct SolveOptions {
  double duality_gap = 1e-6;  // stop at a gap (certificate.hpp) of at most this; > 0
  double time_limit =
      std::numeric_limits<double>::infinity();  // wall seconds, checked each iteration
  std::int64_t iteration_limit = 0;             // 0: the solver's own default
  std::uint64_t seed = 1;    // of the randomised methods; equal seeds give equal answers
  int threads = 1;           // the answer does not depend on it
  Criterion criterion = {};  // D; others only where the back-end's traits list them
  // Weights to begin from (warm_start.hpp), length Q; empty for the back-end's own start. Only
  // where the back-end's traits say takes_start. The caller keeps them alive.
  std::span<const double> start = {};
};

// One point of a run's history. `passes` counts bytes of the set read, over the bytes of the set.
struct TracePoint {
  double seconds = 0.0;
  double passes = 0.0;
  double duality_gap = 0.0;  // infinity while M is singular
  std::int64_t iteration = 0;
};

struct SolveCounters {
  std::int64_t iterations = 0;
  double passes = 0.0;
  double seconds = 0.0;  // wall time of the solve, without the recording of traces
};

// What an external program says of its own run, by its own clock: kept and shown beside what is
// measured, never in its place.
struct OwnAccount {
  std::optional<double> seconds = {};
  std::vector<TracePoint> trace = {};  // seconds and gaps; no passes
};

struct Solution {
  Design design;
  SolveStatus status = SolveStatus::kNumericalFailure;
  std::vector<TracePoint> trace;
  SolveCounters counters;
  std::string message;       // empty, or one line on why it stopped where it did
  OwnAccount account = {};   // external programs alone; likewise:
  WeightRepair repair = {};  // what was done to the weights that it wrote
};

// Watches a run. Called with each new trace point; returning false stops the solver, which then
// returns its best design with status time_limit.
class SolveObserver {
 public:
  virtual ~SolveObserver() = default;
  virtual bool on_progress(const TracePoint& point) = 0;
};

// What a caller may want to know before a run.
struct SolverTraits {
  double reachable_gap = 1e-9;  // checked gap it reaches on well-posed sets of moderate size
  int memory_exponent = 1;      // memory grows as Q^memory_exponent
  bool randomised = false;      // the path depends on options.seed
  bool takes_start = false;     // begins from options.start where there is one
  bool takes_factors = false;   // under criterion D: makes no matrices of a set in factor form
  // The criteria it can solve for.
  std::vector<CriterionKind> criteria = {CriterionKind::kD};
};

class Solver {
 public:
  virtual ~Solver() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  [[nodiscard]] virtual std::string_view description() const = 0;  // one line
  [[nodiscard]] virtual SolverTraits traits() const { return {}; }
  // Throws InputError for options out of range (gap <= 0, negative limits). A back-end need not
  // look at options.criterion unless its traits list more than D: the registry hands out every
  // back-end behind a check that answers `unsupported` for the others. Likewise options.start is
  // checked there, and refused where the traits do not have takes_start.
  [[nodiscard]] virtual Solution solve(const InformationSet& set, const SolveOptions& options,
                                       SolveObserver* observer = nullptr) const = 0;
};

}  // namespace graybox
