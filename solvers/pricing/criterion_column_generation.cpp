#include "solvers/pricing/criterion_column_generation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/random.hpp"
#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/core/candidate_region.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity_error.hpp"
#include "solvers/pricing/candidate_pool.hpp"
#include "solvers/pricing/sensitivity_sample.hpp"
#include "solvers/restricted_problem/restricted_problem.hpp"

namespace graybox {
namespace {

// c of the header: how much more than M the matrix G of a criterion moves.
double magnification(const Criterion& criterion) {
  constexpr double kPricing = 1.0;  // tr(G H_i) itself, for G <= M^-1
  if (criterion.kind() == CriterionKind::kCompound) {
    double largest = 0.0;
    for (const CriterionPart& part : criterion.parts()) {
      largest = std::max(largest, magnification(part.criterion));
    }
    return largest;
  }
  const bool is_power = criterion.kind() == CriterionKind::kPhiP;
  return kPricing + (is_power ? std::max(2.0, criterion.p() + 1.0) : 2.0);
}

class CriterionRun {
 public:
  CriterionRun(const InformationSet& set, const SolveOptions& options,
               std::span<const double> coordinates, Tracer& tracer)
      : set_(set),
        options_(options),
        tracer_(tracer),
        problem_(make_restricted_problem(options.criterion, set.dimension(), coordinates)),
        random_(options.seed) {}

  Solution run(const Design& start);

 private:
  double price(CandidatePool& pool);
  double gap_error(const CandidatePool& all, double gap);
  std::size_t add_violators(const CandidatePool& pool);
  bool improve(double gap, double tolerance);
  void solve_pool(CandidatePool& pool, double tolerance);
  [[nodiscard]] CandidatePool short_list(const CandidatePool& all) const;
  [[nodiscard]] bool out_of_rounds() const {
    return options_.iteration_limit > 0 && rounds_ >= options_.iteration_limit;
  }
  void keep_if_better(double gap);
  Solution finish(SolveStatus status, std::string message = {});

  const InformationSet& set_;
  const SolveOptions& options_;
  Tracer& tracer_;
  std::unique_ptr<RestrictedProblem> problem_;
  Random random_;
  std::int64_t rounds_ = 0;
  double best_gap_ = std::numeric_limits<double>::infinity();  // of a pass over the whole set
  Design best_design_;
};

// The gap over the pool.
double CriterionRun::price(CandidatePool& pool) {
  price_pool(set_, problem_->trace_dual(), options_.threads, pool);
  tracer_.count_candidates(pool.count);
  return pool.largest() - 1.0;
}

// How far rounding can have lowered the gap over the whole set. One pass.
double CriterionRun::gap_error(const CandidatePool& all, double gap) {
  const std::size_t d = set_.dimension();
  const std::vector<double> information = problem_->information();
  InverseCholesky inverse(d);
  if (!inverse.factor(information)) return std::numeric_limits<double>::infinity();
  const double error = sensitivity_error(information, inverse.trace_dual(), d, problem_->size());
  CandidatePool traces;  // tr(M^-1 H_i)
  traces.count = all.count;
  traces.sensitivity = AlignedArray(all.count);
  price_pool(set_, inverse.trace_dual(), options_.threads, traces);
  tracer_.count_candidates(traces.count);
  const double share = magnification(options_.criterion) * error;
  double highest = 0.0;
  for (std::size_t i = 0; i < all.count; ++i) {
    highest = std::max(highest, all.sensitivity[i] + share * traces.sensitivity[i]);
  }
  return highest - (1.0 + gap) + error * (1.0 + gap);
}

std::size_t CriterionRun::add_violators(const CandidatePool& pool) {
  const std::size_t d = set_.dimension();
  std::size_t added = 0;
  for (const std::size_t k : violators(pool.sensitivities(), 1.0, 2 * d, 4 * d, random_)) {
    const std::size_t i = pool.candidate(k);
    added += problem_->add(i, set_.information(i).data(), 0.0) ? 1U : 0U;
  }
  return added;
}

bool CriterionRun::improve(double gap, double tolerance) {
  ++rounds_;
  return problem_->improve(gap, tolerance);
}

// Rounds of price, add, solve on one pool until its gap is at most `tolerance`.
void CriterionRun::solve_pool(CandidatePool& pool, double tolerance) {
  constexpr int kRoundLimit = 30;
  double last_gap = std::numeric_limits<double>::infinity();
  for (int round = 0; round < kRoundLimit && !out_of_rounds() && !tracer_.out_of_time(); ++round) {
    const double gap = price(pool);
    if (gap <= tolerance) return;
    const std::size_t added = add_violators(pool);
    const bool improved = improve(gap, tolerance);
    if (added == 0 && (!improved || !(gap < last_gap))) return;
    last_gap = gap;
  }
}

// The candidates with the largest sensitivities.
CandidatePool CriterionRun::short_list(const CandidatePool& all) const {
  const std::size_t wanted = std::clamp(all.count / 16, std::size_t{512}, std::size_t{16384});
  double threshold = -std::numeric_limits<double>::infinity();
  if (all.count > 2 * wanted) {
    SensitivitySample sample(all.sensitivity.span());
    threshold = std::min(sample.exceeded_by(wanted), all.largest());
  }
  return pool_above(all, all.sensitivity.span(), threshold);
}

void CriterionRun::keep_if_better(double gap) {
  if (!(gap < best_gap_)) return;
  best_gap_ = gap;
  best_design_.weights.assign(set_.candidate_count(), 0.0);
  for (std::size_t k = 0; k < problem_->size(); ++k) {
    best_design_.weights[problem_->indices()[k]] = problem_->weights()[k];
  }
  best_design_.dual_matrix = problem_->dual_matrix();
  best_design_.dual_weights = problem_->dual_weights();
}

Solution CriterionRun::finish(SolveStatus status, std::string message) {
  return tracer_.finish(std::move(best_design_), status, rounds_, std::move(message));
}

Solution CriterionRun::run(const Design& start) {
  constexpr double kRoughGap = 0.1;
  for (std::size_t i = 0; i < start.weights.size(); ++i) {
    if (start.weights[i] > 0.0) problem_->add(i, set_.information(i).data(), start.weights[i]);
  }
  best_design_ = start;
  if (!problem_->refresh()) {
    return finish(SolveStatus::kNumericalFailure, "the start's information matrix is singular");
  }
  improve(kRoughGap, kRoughGap);
  CandidatePool all = sample_pool(set_.candidate_count(), set_.candidate_count(), random_);
  for (int passes_without_progress = 0, stalled_rounds = 0;;) {
    const double gap = price(all);
    tracer_.record(gap, rounds_);
    passes_without_progress = gap < 0.9 * best_gap_ ? 0 : passes_without_progress + 1;
    keep_if_better(gap);
    if (const double asked = options_.duality_gap; gap <= asked) {
      const double error = gap_error(all, gap);
      if (gap + error <= asked) return finish(SolveStatus::kSolved);
      if (!(error < 0.5 * asked)) {
        return finish(SolveStatus::kNumericalFailure,
                      fmt::format("rounding hides up to {:.1e} of the gap", error));
      }
    }
    if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
    if (out_of_rounds()) return finish(SolveStatus::kIterationLimit);
    if (passes_without_progress > 8 || stalled_rounds > 1) {
      return finish(SolveStatus::kNumericalFailure,
                    fmt::format("rounding keeps the gap at {:.1e}", best_gap_));
    }
    CandidatePool list = short_list(all);
    const std::size_t added = add_violators(all);
    if (!improve(gap, options_.duality_gap) && added == 0) ++stalled_rounds;
    solve_pool(list, std::max(0.5 * options_.duality_gap, 1e-2 * gap));
  }
}

}  // namespace

Solution solve_criterion(const InformationSet& set, const SolveOptions& options,
                         const Design& start, Tracer& tracer) {
  constexpr double kToleratedError = 0.1;  // of the sensitivities, as a share of the gap
  SolveOptions resolved = options;
  resolved.criterion = over_candidates(options.criterion, set);
  const auto run_on = [&](const ConditionedSet& conditioned) {
    return CriterionRun(conditioned.set(), resolved, conditioned.coordinates(), tracer).run(start);
  };
  const ConditionedSet tolerable(set, kToleratedError * options.duality_gap, tracer);
  Solution solution = run_on(tolerable);
  if (solution.status != SolveStatus::kNumericalFailure || tolerable.whitened()) return solution;
  const ConditionedSet accurate(set, kSensitivityAccuracy * options.duality_gap, tracer);
  return accurate.whitened() ? run_on(accurate) : solution;
}

}  // namespace graybox
