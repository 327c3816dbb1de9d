#include "solvers/column_generation/column_generation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/random.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/best_design.hpp"
#include "solvers/column_generation/fallback.hpp"
#include "solvers/column_generation/priced_set.hpp"
#include "solvers/column_generation/screening.hpp"
#include "solvers/column_generation/well_conditioned_start.hpp"
#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/core/warm_start.hpp"
#include "solvers/kernels/dense_kernels.hpp"
#include "solvers/pricing/candidate_pool.hpp"
#include "solvers/pricing/candidate_pricer.hpp"
#include "solvers/pricing/criterion_column_generation.hpp"
#include "solvers/pricing/sensitivity_sample.hpp"
#include "solvers/restricted_problem/working_set.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kForgivenShare = 0.1;    // of the gap asked for that rounding may hide
constexpr std::size_t kFewestStages = 4;  // of a pass: with fewer, a sample does as well
constexpr std::size_t kBatch = 64;        // candidates that are whitened together

std::string rounding_message(double error) {
  return fmt::format("rounding hides up to {:.1e} of the gap", error);
}

// Length of a short list of these candidates.
std::size_t wanted_of(const CandidatePool& all) {
  return std::clamp(all.count / 64, std::size_t{512}, std::size_t{16384});
}

// Whose coordinates a run works in: the set's own, which it leaves where rounding hides too much of
// the gap, or those of ConditionedSet, beyond which there are no better ones.
enum class Coordinates : std::int8_t { kOwn, kWhitened };

class ColumnGenerationRun {
 public:
  ColumnGenerationRun(const InformationSet& set, Coordinates coordinates,
                      const SolveOptions& options, Tracer& tracer)
      : set_(set),
        coordinates_(coordinates),
        options_(options),
        tracer_(tracer),
        working_(set.dimension()),
        row_(set.packed_size()),
        random_(options.seed),
        priced_(set, options.threads, random_),
        dimension_(static_cast<double>(set.dimension())) {}

  MethodOutcome run();

 private:
  double price(CandidatePool& pool);
  std::size_t add_violators(const CandidatePool& pool);
  void solve_pool(CandidatePool& pool, double tolerance, int round_limit);
  [[nodiscard]] bool out_of_rounds() const {
    return options_.iteration_limit > 0 && rounds_ >= options_.iteration_limit;
  }
  bool improve(double gap, double tolerance);
  [[nodiscard]] bool begin_from_start();
  [[nodiscard]] bool warm_up();
  void pass_in_stages();
  [[nodiscard]] std::optional<CandidatePool> price_open(double error, double& gap);
  [[nodiscard]] bool rounding_hides_too_much() const;
  [[nodiscard]] CandidatePool short_list(const CandidatePool& all);
  [[nodiscard]] static CandidatePool largest_of(const CandidatePool& all);
  void apply_frobenius_rule(CandidatePool& list, double max_sensitivity);
  void whitened_norms(CandidatePool& list, std::size_t from, std::span<double> norms,
                      std::vector<double>& scratch) const;
  [[nodiscard]] MethodOutcome finish(SolveStatus status, std::string message = {}) const;

  const InformationSet& set_;
  Coordinates coordinates_;
  const SolveOptions& options_;
  Tracer& tracer_;
  WorkingSet working_;
  std::vector<double> row_;  // of a candidate in factor form
  Random random_;
  PricedSet priced_;
  double dimension_;
  std::int64_t rounds_ = 0;
  bool start_unused_ = false;
  BestDesign best_;
};

// w_i for the pool; returns the largest.
double ColumnGenerationRun::price(CandidatePool& pool) {
  price_pool(set_, working_.inverse(), options_.threads, pool);
  tracer_.count_candidates(pool.count);
  return pool.largest();
}

// Among ties every violator is as good as many others, and all of them take weight. Where they have
// made a working set large, fewer are added, for a Newton step costs its square and cube.
std::size_t ColumnGenerationRun::add_violators(const CandidatePool& pool) {
  constexpr std::size_t kLarge = 5;  // times d
  const std::size_t d = set_.dimension();
  const std::size_t wanted = working_.size() > kLarge * d ? d : 2 * d;
  std::size_t added = 0;
  for (const std::size_t k : violators(pool.sensitivities(), dimension_, wanted, 4 * d, random_)) {
    const std::size_t i = pool.candidate(k);
    added += working_.add(i, set_.packed(i, row_).data(), 0.0) ? 1U : 0U;
  }
  return added;
}

// Newton on the working set after a pass with the given gap. False where no further step is
// possible.
bool ColumnGenerationRun::improve(double gap, double tolerance) {
  ++rounds_;
  const WorkingSetStatus status = working_.improve(gap, tolerance);
  return status == WorkingSetStatus::kConverged || status == WorkingSetStatus::kStopped;
}

// Rounds of price, add, solve on one pool until its gap is at most `tolerance`.
void ColumnGenerationRun::solve_pool(CandidatePool& pool, double tolerance, int round_limit) {
  for (int round = 0; round < round_limit && !out_of_rounds() && !tracer_.out_of_time(); ++round) {
    const double gap = price(pool) / dimension_ - 1.0;
    if (gap <= tolerance) return;
    const std::size_t added = add_violators(pool);
    if (!improve(gap, tolerance) && added == 0) return;
  }
}

// The design that is given, if any, with the best weights on its support. False where there is none
// or its information matrix is singular.
bool ColumnGenerationRun::begin_from_start() {
  constexpr int kStepLimit = 10;
  if (options_.start.empty()) return false;
  start_unused_ = !start_from_design(set_, simplex_start(options_.start), tracer_, working_);
  if (start_unused_) return false;
  working_.optimise(0.5 * options_.duality_gap, kStepLimit);
  return true;
}

// A rough design from a sample. The gap over the whole set is seldom below a tenth then, so more
// precision than that would be lost.
bool ColumnGenerationRun::warm_up() {
  constexpr double kRoughGap = 0.1;
  const std::size_t total = set_.candidate_count();
  const std::size_t first =
      total <= 1024 ? total : std::clamp(total / 16, std::size_t{256}, std::size_t{4096});
  CandidatePool sample = sample_pool(total, first, random_);
  if (!well_conditioned_start(set_, sample, random_, tracer_, working_)) return false;
  working_.optimise(kRoughGap, 4);
  if (first < total) solve_pool(sample, kRoughGap, 4);
  return true;
}

// A first pass over a large set, and a design that is nearly optimal. Each stage is priced with the
// design that the stages before it have led to. Where rounds, time or digits run out, the pass ends
// early, and the next one is over the whole set.
void ColumnGenerationRun::pass_in_stages() {
  constexpr double kRoughGap = 0.003;
  constexpr double kHigh = 0.9;  // of d: the candidates of a stage on which to go on
  constexpr int kRounds = 3;
  for (std::size_t stage = 0; stage < priced_.stages(); ++stage) {
    if (out_of_rounds() || tracer_.out_of_time() || rounding_hides_too_much()) return;
    tracer_.count_candidates(priced_.price_stage(stage, working_));
    if (stage + 1 == priced_.stages()) break;
    CandidatePool high = priced_.high(stage, kHigh * dimension_);
    const double gap = high.count > 0 ? high.largest() / dimension_ - 1.0 : 0.0;
    if (gap <= kRoughGap) continue;
    add_violators(high);
    improve(gap, kRoughGap);
    solve_pool(high, kRoughGap, kRounds);
  }
  const double asked = options_.duality_gap;
  CandidatePool list = largest_of(priced_.all());
  add_violators(list);
  improve(std::max(asked, std::ranges::max(list.sensitivities()) / dimension_ - 1.0), asked);
  solve_pool(list, 0.5 * asked, 30);
}

bool ColumnGenerationRun::rounding_hides_too_much() const {
  return coordinates_ == Coordinates::kOwn &&
         working_.sensitivity_error() > kForgivenShare * options_.duality_gap;
}

// The gap over the whole set. Where the last pass leaves few candidates open, these are priced and
// returned. What it bounds is bounded so low that this gap and its rounding error together may
// still be what is asked. Else all are priced.
std::optional<CandidatePool> ColumnGenerationRun::price_open(double error, double& gap) {
  const double asked = options_.duality_gap;
  if (error < 0.5 * asked) {
    const double bounded = 0.5 * (asked - error);
    std::optional<CandidatePool> open = priced_.open(working_, dimension_ * (1.0 + bounded));
    if (open) {
      gap = std::max(price(*open) / dimension_ - 1.0, bounded);
      return open;
    }
  }
  priced_.price(working_);
  tracer_.count_passes(1.0);
  gap = priced_.all().largest() / dimension_ - 1.0;
  return std::nullopt;
}

MethodOutcome ColumnGenerationRun::run() {
  const bool warm = begin_from_start();
  if (!warm && !warm_up()) {
    return finish(SolveStatus::kUnsupported,
                  "the sum of all information matrices is singular in double precision");
  }
  if (!warm && priced_.stages() >= kFewestStages) pass_in_stages();
  const double asked = options_.duality_gap;
  for (int passes_without_progress = 0;;) {
    const double error = working_.sensitivity_error();
    if (rounding_hides_too_much()) {
      return finish(SolveStatus::kNumericalFailure, rounding_message(error));
    }
    double gap = 0.0;
    const std::optional<CandidatePool> open = price_open(error, gap);
    tracer_.record(gap, rounds_);
    passes_without_progress = gap < 0.9 * best_.gap() ? 0 : passes_without_progress + 1;
    best_.offer(gap, working_.indices(), working_.weights());
    if (gap + error <= asked) return finish(SolveStatus::kSolved);
    if (gap <= asked && error >= 0.5 * asked) {
      return finish(SolveStatus::kNumericalFailure, rounding_message(error));
    }
    if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
    if (out_of_rounds()) return finish(SolveStatus::kIterationLimit);
    if (passes_without_progress > 8) {
      return finish(SolveStatus::kNumericalFailure,
                    fmt::format("rounding keeps the gap at {:.1e}", best_.gap()));
    }
    const CandidatePool& seen = open ? *open : priced_.all();
    CandidatePool list =
        short_list(seen);  // before the working set moves: the rules hold for this design
    add_violators(seen);
    improve(gap, asked);
    solve_pool(list, 0.5 * asked, 30);
  }
}

// About as many as are wanted of the largest sensitivities, by a quantile of a sample.
CandidatePool ColumnGenerationRun::largest_of(const CandidatePool& all) {
  SensitivitySample sample(all.sensitivity.span());
  return pool_above(all, all.sensitivity.span(), sample.exceeded_by(wanted_of(all)));
}

// The candidates on which to go on after candidates of the set were priced. Where the safe rules
// leave few enough, those: they hold every support point among the candidates priced. Otherwise
// those of the largest sensitivities. Either is a guess that the next look at the set corrects.
CandidatePool ColumnGenerationRun::short_list(const CandidatePool& all) {
  const std::size_t wanted = wanted_of(all);
  if (all.count <= 2 * wanted) return pool_above(all, all.sensitivity.span(), -kInfinity);
  SensitivitySample sample(all.sensitivity.span());
  const double largest = all.largest();
  const double safe = harman_pronzato_threshold(largest, set_.dimension());
  const double guess = sample.exceeded_by(wanted);
  if (safe >= guess) return pool_above(all, all.sensitivity.span(), safe);
  if (safe < sample.exceeded_by(4 * wanted)) return pool_above(all, all.sensitivity.span(), guess);
  CandidatePool list = pool_above(all, all.sensitivity.span(), safe);
  apply_frobenius_rule(list, largest);
  return list;
}

// ||B_i||_F^2 of a few candidates of the list, B_i = X H_i X^T, and tr B_i in place of their
// sensitivities. `scratch` is sized on first use.
void ColumnGenerationRun::whitened_norms(CandidatePool& list, std::size_t from,
                                         std::span<double> norms,
                                         std::vector<double>& scratch) const {
  const std::size_t d = set_.dimension();
  const auto x = working_.inverse().inverse_factor();
  double* traces = list.sensitivity.data() + from;
  if (set_.has_factors()) {
    scratch.resize(set_.rank() * d);
    for (std::size_t k = 0; k < norms.size(); ++k) {
      norms[k] = set_.rank() == 1
                     ? traces[k] * traces[k]
                     : squared_whitened_norm_of_factor(set_.factor(list.indices[from + k]),
                                                       set_.rank(), x, scratch);
    }
    return;
  }
  const std::size_t stride = (set_.packed_size() + 7) / 8 * 8, rows = kBatch * stride;
  scratch.resize(rows + 8 * d * (d + 1));
  dense_kernels().whiten(set_.data(), list.indices.data() + from, norms.size(), d, x.data(),
                         scratch.data(), stride, traces, scratch.data() + rows);
  for (std::size_t k = 0; k < norms.size(); ++k) {
    const double* row = scratch.data() + k * stride;
    norms[k] = std::inner_product(row, row + stride, row, 0.0);
  }
}

// Keeps the candidates that formula (6) of screening.hpp can't exclude from every optimal support.
void ColumnGenerationRun::apply_frobenius_rule(CandidatePool& list, double max_sensitivity) {
  const FrobeniusRule rule(max_sensitivity, set_.dimension());
  std::array<double, kBatch> norms{};
  std::vector<double> scratch;
  std::size_t kept = 0;
  for (std::size_t from = 0; from < list.count; from += kBatch) {
    const std::size_t count = std::min(kBatch, list.count - from);
    whitened_norms(list, from, std::span(norms).first(count), scratch);
    for (std::size_t k = 0; k < count; ++k) {
      if (rule.deletable(list.sensitivity[from + k], norms[k])) continue;
      list.indices[kept] = list.indices[from + k];
      list.sensitivity[kept] = list.sensitivity[from + k];
      ++kept;
    }
  }
  tracer_.count_candidates(list.count);
  list.indices.resize(kept);
  list.count = kept;
}

MethodOutcome ColumnGenerationRun::finish(SolveStatus status, std::string message) const {
  Design design;
  if (status != SolveStatus::kUnsupported) design = best_.design(set_.candidate_count());
  if (start_unused_) message = without_start(message);
  return {std::move(design), status, best_.gap(), working_.sensitivity_error(), rounds_,
          std::move(message)};
}

// Where the digits of double precision alone stand between the best design and the gap asked for,
// the checker decides, which has more. It does so for every claim about E: the dual matrix that
// proves it was found in other coordinates, and may not have survived the way back.
Solution judged(const InformationSet& set, const SolveOptions& options, Solution solution) {
  const bool is_claim = solution.status == SolveStatus::kSolved;
  const bool is_doubtful = is_claim && options.criterion.kind() == CriterionKind::kE;
  if (!is_doubtful && solution.status != SolveStatus::kNumericalFailure) return solution;
  if (solution.design.weights.empty()) return solution;
  const double asked = options.duality_gap;
  const Certificate proof = certify(set, solution.design, options.criterion, asked);
  if (proves(proof, asked)) {
    solution.status = SolveStatus::kSolved;
    solution.message.clear();
  } else if (is_claim) {
    solution.status = SolveStatus::kNumericalFailure;
    solution.message = fmt::format(
        "rounding leaves a dual matrix that proves a gap of {:.1e} alone", largest_gap(proof));
  }
  return solution;
}

// A D-optimal design that is good enough to start from, then the criterion's own method.
Solution solve_from_rough(const InformationSet& set, const SolveOptions& options, Tracer& tracer) {
  SolveOptions rough = options;
  rough.start = {};
  rough.criterion = Criterion();
  rough.duality_gap = std::max(0.1, options.duality_gap);
  rough.iteration_limit = 0;
  Solution start = ColumnGeneration().solve(set, rough);
  tracer.count_passes(start.counters.passes);
  if (start.status == SolveStatus::kUnsupported) return start;
  return judged(set, options, solve_criterion(set, options, start.design, tracer));
}

// The same from the design that is given. Where it is singular, or leads nowhere, as without it.
Solution solve_other_criterion(const InformationSet& set, const SolveOptions& options,
                               Tracer& tracer) {
  if (options.start.empty()) return solve_from_rough(set, options, tracer);
  WorkingSet working(set.dimension());
  if (!start_from_design(set, simplex_start(options.start), tracer, working)) {
    Solution solution = solve_from_rough(set, options, tracer);
    solution.message = without_start(solution.message);
    return solution;
  }
  Design start;
  start.weights.assign(set.candidate_count(), 0.0);
  for (std::size_t k = 0; k < working.size(); ++k) {
    start.weights[working.indices()[k]] = working.weights()[k];
  }
  Solution solution = judged(set, options, solve_criterion(set, options, start, tracer));
  if (solution.status != SolveStatus::kNumericalFailure) return solution;
  return solve_from_rough(set, options, tracer);
}

[[nodiscard]] bool wants_better_coordinates(const MethodOutcome& outcome) {
  return outcome.status == SolveStatus::kNumericalFailure ||
         outcome.status == SolveStatus::kUnsupported;
}

MethodOutcome solve_d(const InformationSet& set, const SolveOptions& options, Tracer& tracer) {
  MethodOutcome own = ColumnGenerationRun(set, Coordinates::kOwn, options, tracer).run();
  if (!wants_better_coordinates(own)) return own;
  const ConditionedSet conditioned(set, 0.0, tracer, options.threads);
  MethodOutcome whitened =
      ColumnGenerationRun(conditioned.set(), Coordinates::kWhitened, options, tracer).run();
  if (!wants_better_coordinates(whitened)) return whitened;
  return finish_with_another(conditioned.set(), options, ColumnGeneration().name(),
                             std::move(whitened), tracer);
}

}  // namespace

Solution ColumnGeneration::solve(const InformationSet& set, const SolveOptions& options,
                                 SolveObserver* observer) const {
  Tracer tracer(set, options, observer);
  if (!options.criterion.is_solved_as_d()) {
    options.criterion.require_fits(set);
    return solve_other_criterion(set, options, tracer);
  }
  MethodOutcome outcome = solve_d(set, options, tracer);
  return tracer.finish(std::move(outcome.design), outcome.status, outcome.iterations,
                       std::move(outcome.message));
}

}  // namespace graybox
