#include "graybox/solvers/column_generation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "graybox/problems/kernels/kernels.hpp"
#include "graybox/problems/packed_matrix.hpp"
#include "graybox/problems/random.hpp"
#include "graybox/solvers/best_design.hpp"
#include "graybox/solvers/candidate_pool.hpp"
#include "graybox/solvers/conditioned_set.hpp"
#include "graybox/solvers/criterion_column_generation.hpp"
#include "graybox/solvers/kernels/dense_kernels.hpp"
#include "graybox/solvers/screening.hpp"
#include "graybox/solvers/sensitivity_sample.hpp"
#include "graybox/solvers/tracer.hpp"
#include "graybox/solvers/working_set.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class ColumnGenerationRun {
 public:
  ColumnGenerationRun(const InformationSet& set, const SolveOptions& options, Tracer& tracer)
      : set_(set),
        options_(options),
        tracer_(tracer),
        working_(set.dimension()),
        random_(options.seed),
        dimension_(static_cast<double>(set.dimension())) {}

  Solution run();

 private:
  [[nodiscard]] bool start(const CandidatePool& pool);
  [[nodiscard]] bool start_from(const std::vector<std::size_t>& candidates, bool equalise);
  double price(CandidatePool& pool);
  std::size_t add_violators(const CandidatePool& pool);
  void solve_pool(CandidatePool& pool, double tolerance, int round_limit);
  [[nodiscard]] bool out_of_rounds() const {
    return options_.iteration_limit > 0 && rounds_ >= options_.iteration_limit;
  }
  bool improve(double gap, double tolerance);
  [[nodiscard]] bool warm_up();
  [[nodiscard]] CandidatePool short_list(const CandidatePool& all);
  void apply_frobenius_rule(CandidatePool& list, double max_sensitivity);
  Solution finish(SolveStatus status, std::string message = {});

  const InformationSet& set_;
  const SolveOptions& options_;
  Tracer& tracer_;
  WorkingSet working_;
  Random random_;
  double dimension_;
  std::int64_t rounds_ = 0;
  BestDesign best_;
};

// First working set: a dozen multiplicative steps on the pool from equal weights, then the heaviest
// few. Where the pool sees too few directions (candidates that inform about one parameter each) the
// whole set is tried, and last with weights that give each candidate's matrix the same size.
bool ColumnGenerationRun::start(const CandidatePool& pool) {
  std::vector<std::size_t> candidates(pool.count);
  for (std::size_t k = 0; k < pool.count; ++k) candidates[k] = pool.candidate(k);
  if (start_from(candidates, false)) return true;
  candidates.resize(set_.candidate_count());
  std::iota(candidates.begin(), candidates.end(), std::size_t{0});
  return start_from(candidates, false) || start_from(candidates, true);
}

bool ColumnGenerationRun::start_from(const std::vector<std::size_t>& candidates, bool equalise) {
  constexpr int kSteps = 4;
  const std::size_t p = set_.packed_size();
  const std::size_t d = set_.dimension();
  const std::size_t count = candidates.size();
  AlignedArray rows(count * p);
  std::vector<double> weights(count);
  for (std::size_t k = 0; k < count; ++k) {
    const auto row = set_.information(candidates[k]);
    std::ranges::copy(row, rows.begin() + k * p);
    double size = 0.0;
    for (std::size_t j = 0; equalise && j < d; ++j) size += row[packed_index(j, j)];
    // Random factors break ties between candidates that are images of one another.
    weights[k] = (0.9 + 0.2 * random_.uniform()) / (size > 0.0 ? size : 1.0);
  }
  tracer_.count_candidates(count);
  std::vector<double> matrix(p, 0.0);
  kernels().accumulate(rows.data(), count, p, weights.data(), matrix.data());
  InverseCholesky inverse(d);
  std::vector<double> sensitivity(count);
  for (int step = 0; step < kSteps; ++step) {
    if (!inverse.factor(matrix)) return false;
    std::ranges::fill(matrix, 0.0);
    kernels().reweigh(rows.data(), count, p, inverse.trace_dual().data(), 1.0 / dimension_,
                      weights.data(), sensitivity.data(), matrix.data());
    tracer_.count_candidates(count);
  }
  // The heaviest few; more of them while their matrix alone is singular.
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t wanted = 3 * d;; wanted *= 2) {
    const std::size_t kept = std::min(wanted, count);
    std::ranges::nth_element(order, order.begin() + static_cast<std::ptrdiff_t>(kept - 1),
                             [&](std::size_t a, std::size_t b) { return weights[a] > weights[b]; });
    working_.clear();
    for (std::size_t k = 0; k < kept; ++k) {
      const std::size_t i = candidates[order[k]];
      working_.add(i, set_.information(i).data(), weights[order[k]]);
    }
    if (working_.refresh()) return true;
    if (kept == count) return false;
  }
}

// w_i for the pool; returns the largest.
double ColumnGenerationRun::price(CandidatePool& pool) {
  price_pool(set_, working_.inverse().trace_dual(), options_.threads, pool);
  tracer_.count_candidates(pool.count);
  return pool.largest();
}

std::size_t ColumnGenerationRun::add_violators(const CandidatePool& pool) {
  const std::size_t d = set_.dimension();
  std::size_t added = 0;
  for (const std::size_t k : violators(pool.sensitivities(), dimension_, 2 * d, 4 * d, random_)) {
    const std::size_t i = pool.candidate(k);
    added += working_.add(i, set_.information(i).data(), 0.0) ? 1U : 0U;
  }
  return added;
}

// Newton on the working set after a pass with the given gap. False where no further step is possible.
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

// A rough design from a sample, and for large sets from a larger sample after it.
bool ColumnGenerationRun::warm_up() {
  constexpr double kRoughGap = 0.03;
  const std::size_t total = set_.candidate_count();
  const std::size_t first =
      total <= 1024 ? total : std::clamp(total / 16, std::size_t{256}, std::size_t{4096});
  CandidatePool sample = sample_pool(total, first, random_);
  if (!start(sample)) return false;
  working_.optimise(kRoughGap, 4);
  if (first < total) solve_pool(sample, kRoughGap, 4);
  for (std::size_t size = 16 * first; size * 4 < total; size *= 16) {
    sample = sample_pool(total, size, random_);
    solve_pool(sample, kRoughGap, 3);
  }
  return true;
}

Solution ColumnGenerationRun::run() {
  if (!warm_up()) {
    return finish(SolveStatus::kUnsupported,
                  "the sum of all information matrices is singular in double precision");
  }
  CandidatePool all = sample_pool(set_.candidate_count(), set_.candidate_count(), random_);
  for (int passes_without_progress = 0;;) {
    const double gap = price(all) / dimension_ - 1.0;
    tracer_.record(gap, rounds_);
    passes_without_progress = gap < 0.9 * best_.gap() ? 0 : passes_without_progress + 1;
    best_.offer(gap, working_.indices(), working_.weights());
    if (gap <= options_.duality_gap) return finish(SolveStatus::kSolved);
    if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
    if (out_of_rounds()) return finish(SolveStatus::kIterationLimit);
    if (passes_without_progress > 8) {
      return finish(SolveStatus::kNumericalFailure,
                    fmt::format("rounding keeps the gap at {:.1e}", best_.gap()));
    }
    CandidatePool list =
        short_list(all);  // before the working set moves: the rules hold for this design
    add_violators(all);
    improve(gap, options_.duality_gap);
    solve_pool(list, 0.5 * options_.duality_gap, 30);
  }
}

// The candidates on which to go on after a pass over the whole set. Where the safe rules leave few
// enough, those: they hold every support point, so that the next pass over the set is the last.
// Otherwise about as many as are wanted of the largest sensitivities, a guess that the next pass
// corrects; its threshold is a quantile of a sample.
CandidatePool ColumnGenerationRun::short_list(const CandidatePool& all) {
  const std::size_t wanted = std::clamp(all.count / 64, std::size_t{512}, std::size_t{16384});
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

// Keeps the candidates that formula (6) of screening.hpp can't exclude from every optimal support.
void ColumnGenerationRun::apply_frobenius_rule(CandidatePool& list, double max_sensitivity) {
  constexpr std::size_t kBatch = 64;
  const FrobeniusRule rule(max_sensitivity, set_.dimension());
  const std::size_t stride = (set_.packed_size() + 7) / 8 * 8;
  const std::size_t d = set_.dimension();
  std::vector<double> whitened(kBatch * stride), scratch(8 * d * (d + 1)), traces(kBatch);
  std::size_t kept = 0;
  for (std::size_t from = 0; from < list.count; from += kBatch) {
    const std::size_t count = std::min(kBatch, list.count - from);
    dense_kernels().whiten(set_.data(), list.indices.data() + from, count, d,
                           working_.inverse().inverse_factor().data(), whitened.data(), stride,
                           traces.data(), scratch.data());
    for (std::size_t k = 0; k < count; ++k) {
      const double* row = whitened.data() + k * stride;
      const double squared_norm = std::inner_product(row, row + stride, row, 0.0);
      if (rule.deletable(traces[k], squared_norm)) continue;
      list.indices[kept] = list.indices[from + k];
      list.sensitivity[kept] = list.sensitivity[from + k];
      ++kept;
    }
  }
  tracer_.count_candidates(list.count);
  list.indices.resize(kept);
  list.count = kept;
}

Solution ColumnGenerationRun::finish(SolveStatus status, std::string message) {
  Design design;
  if (status != SolveStatus::kUnsupported) design = best_.design(set_.candidate_count());
  return tracer_.finish(std::move(design), status, rounds_, std::move(message));
}

}  // namespace

namespace {

// A D-optimal design that is good enough to start from, then the criterion's own method.
Solution solve_other_criterion(const InformationSet& set, const SolveOptions& options,
                               Tracer& tracer) {
  SolveOptions rough = options;
  rough.criterion = Criterion();
  rough.duality_gap = std::max(0.1, options.duality_gap);
  rough.iteration_limit = 0;
  Solution start = ColumnGeneration().solve(set, rough);
  tracer.count_passes(start.counters.passes);
  if (start.status == SolveStatus::kUnsupported) return start;
  return solve_criterion(set, options, start.design, tracer);
}

}  // namespace

Solution ColumnGeneration::solve(const InformationSet& set, const SolveOptions& options,
                                 SolveObserver* observer) const {
  Tracer tracer(set, options, observer);
  if (options.criterion.kind() != CriterionKind::kD) {
    options.criterion.require_fits(set);
    return solve_other_criterion(set, options, tracer);
  }
  Solution solution = ColumnGenerationRun(set, options, tracer).run();
  if (solution.status != SolveStatus::kNumericalFailure &&
      solution.status != SolveStatus::kUnsupported) {
    return solution;
  }
  const ConditionedSet conditioned(set, kSensitivityAccuracy * options.duality_gap, tracer);
  if (!conditioned.whitened()) return solution;
  return ColumnGenerationRun(conditioned.set(), options, tracer).run();
}

}  // namespace graybox
