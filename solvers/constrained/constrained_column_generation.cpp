#include "solvers/constrained/constrained_column_generation.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/conditioning/twofold_congruence.hpp"
#include "solvers/constrained/constrained_working_set.hpp"
#include "solvers/constrained/linear_programme.hpp"
#include "solvers/constrained/multiplier_bound.hpp"
#include "solvers/core/candidate_region.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/pricing/candidate_pool.hpp"
#include "solvers/pricing/sensitivity_sample.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kShareOfGap = 0.5;  // the rest is for the checker, whose multipliers are its own
constexpr std::size_t kManyPerParameter = 6;  // members that the constraints need
constexpr std::size_t kMostMembers = 100'000;

// The set in the coordinates to work in, with the prior in them.
struct Coordinates {
  const InformationSet& set;
  std::span<const double> transformation;
  std::vector<double> prior;
};

class ConstrainedRun {
 public:
  ConstrainedRun(const Coordinates& coordinates, const DesignConstraints& constraints,
                 const SolveOptions& options, Tracer& tracer)
      : set_(coordinates.set),
        constraints_(constraints),
        options_(options),
        tracer_(tracer),
        prior_(coordinates.prior),
        working_(options.criterion, set_.dimension(), coordinates.transformation, prior_,
                 constraints),
        random_(options.seed),
        largest_effort_(set_.candidate_count()) {
    for (std::size_t i = 0; i < largest_effort_.size(); ++i) {
      largest_effort_[i] = constraints.largest_effort(i);
    }
  }

  ConstrainedSolution run();

 private:
  enum class Start : std::int8_t { kReady, kInfeasible, kSingular };
  Start begin();
  bool add_vertex(const CandidatePool& sample);
  bool price_uniformly(const CandidatePool& sample, std::vector<double>& dual) const;
  double price(CandidatePool& pool);
  std::size_t add_violators(const CandidatePool& pool);
  void solve_pool(CandidatePool& pool, double tolerance);
  bool improve(double gap, double tolerance);
  [[nodiscard]] CandidatePool short_list(const CandidatePool& all) const;
  void keep_if_better(double gap);
  ConstrainedSolution finish(SolveStatus status, std::string message = {});

  const InformationSet& set_;
  const DesignConstraints& constraints_;
  const SolveOptions& options_;
  Tracer& tracer_;
  const std::vector<double>& prior_;
  ConstrainedWorkingSet working_;
  Random random_;
  std::vector<double> reduced_, largest_effort_;
  std::vector<std::size_t> sample_;  // that the start was chosen from
  std::int64_t rounds_ = 0;
  double best_gap_ = kInfinity;
  std::vector<double> best_efforts_, best_multipliers_;
  double best_sharpness_ = 1.0;
};

[[noreturn]] void throw_contradiction(const DesignConstraints& constraints) {
  const std::vector<std::string> rows = contradicting_rows(constraints);
  throw InputError(fmt::format(
      "no design obeys the constraints: '{}' can't be met{}; relax one of them",
      fmt::join(rows, "', '"), rows.size() > 1 ? " together" : " with the candidates' own limits"));
}

// Candidates with which the constraints can be obeyed: a vertex of the sample's, or of all. False
// where there are none.
bool ConstrainedRun::add_vertex(const CandidatePool& sample) {
  const auto add = [&](std::span<const std::size_t> candidates, const LinearOptimum& optimum) {
    for (std::size_t k = 0; k < optimum.efforts.size(); ++k) {
      const std::size_t i = candidates.empty() ? k : candidates[k];
      if (optimum.efforts[k] > 0.0) working_.add(i, set_.information(i).data());
    }
  };
  std::vector<double> gains;
  const std::size_t few = kManyPerParameter * set_.dimension();
  for (const std::size_t most : {few, sample.count}) {
    std::vector<std::size_t> best;
    gains.clear();
    for (const std::size_t k : violators(sample.sensitivities(), 0.0, most, most, random_)) {
      best.push_back(sample.candidate(k));
      gains.push_back(sample.sensitivity[k]);
    }
    const LinearOptimum optimum = maximise_linear(constraints_, best, gains);
    if (optimum.status != LinearStatus::kOptimal) continue;
    add(best, optimum);
    return true;
  }
  gains.assign(set_.candidate_count(), 1.0);
  const LinearOptimum optimum = maximise_linear(constraints_, {}, gains);
  if (optimum.status == LinearStatus::kInfeasible) return false;
  add({}, optimum);
  return true;
}

// M^-1/d of the prior and the sample, uniformly run.
bool ConstrainedRun::price_uniformly(const CandidatePool& sample, std::vector<double>& dual) const {
  std::vector<double> weights(set_.candidate_count(), 0.0), matrix(set_.packed_size());
  for (std::size_t k = 0; k < sample.count; ++k) {
    const std::size_t i = sample.candidate(k);
    weights[i] = largest_effort_[i] / static_cast<double>(sample.count);
  }
  information_matrix(set_, weights, matrix);
  for (std::size_t k = 0; k < prior_.size(); ++k) matrix[k] += prior_[k];
  InverseFactor factor;
  if (!invert(matrix, set_.dimension(), factor)) return false;
  dual = std::move(factor.trace_dual);
  return true;
}

// The first members.
ConstrainedRun::Start ConstrainedRun::begin() {
  const std::size_t total = set_.candidate_count(), d = set_.dimension();
  const std::size_t count =
      total <= 1024 ? total : std::clamp(total / 16, std::size_t{512}, std::size_t{4096});
  CandidatePool sample = sample_pool(total, count, random_);
  std::vector<double> dual;
  if (!price_uniformly(sample, dual)) {
    sample = sample_pool(total, total, random_);
    tracer_.count_passes(1.0);
    if (!price_uniformly(sample, dual)) {
      const std::vector<double> gains(total, 1.0);
      const LinearOptimum any = maximise_linear(constraints_, {}, gains);
      return any.status == LinearStatus::kInfeasible ? Start::kInfeasible : Start::kSingular;
    }
  }
  for (std::size_t k = 0; k < sample.count; ++k) {
    if (largest_effort_[sample.candidate(k)] > 0.0) {
      sample_.push_back(sample.candidate(k));
    }
  }
  price_pool(set_, dual, options_.threads, sample);
  tracer_.count_candidates(2 * sample.count);
  for (std::size_t k = 0; k < sample.count; ++k) {
    sample.sensitivity[k] *= std::min(largest_effort_[sample.candidate(k)], 1e30);
  }
  if (!add_vertex(sample)) return Start::kInfeasible;
  // Where the limits ask for many, all take part, and the working set is solved by columns.
  if (working_.size() > kManyPerParameter * d && total <= kMostMembers) {
    for (std::size_t i = 0; i < total; ++i) {
      if (largest_effort_[i] > 0.0) working_.add(i, set_.information(i).data());
    }
    return Start::kReady;
  }
  const std::size_t wanted = 3 * std::max(d, working_.size());
  for (const std::size_t k : violators(sample.sensitivities(), 0.0, wanted, 2 * wanted, random_)) {
    const std::size_t i = sample.candidate(k);
    working_.add(i, set_.information(i).data());
  }
  return Start::kReady;
}

// The gap over the pool; its candidates' reduced gains replace their sensitivities.
double ConstrainedRun::price(CandidatePool& pool) {
  price_pool(set_, working_.trace_dual(), options_.threads, pool);
  tracer_.count_candidates(pool.count);
  reduced_.resize(pool.count);
  const auto bound = multiplier_bound<double>(constraints_, pool.indices, pool.sensitivities(),
                                              working_.multipliers(), reduced_);
  const auto at = [&](std::size_t i) -> double* {
    if (pool.whole()) return &pool.sensitivity[i];
    const auto found = std::ranges::lower_bound(pool.indices, i);
    if (found == pool.indices.end() || *found != i) return nullptr;
    return &pool.sensitivity[static_cast<std::size_t>(found - pool.indices.begin())];
  };
  for (std::size_t k = 0; k < pool.count; ++k) {
    const double effort = largest_effort_[pool.candidate(k)];
    pool.sensitivity[k] = effort > 0.0 ? reduced_[k] * effort : -kInfinity;
  }
  for (const std::size_t i : working_.candidates()) {
    if (double* gain = at(i)) *gain = -kInfinity;
  }
  return std::max(working_.prior_gain() + bound.value - 1.0, 0.0);
}

std::size_t ConstrainedRun::add_violators(const CandidatePool& pool) {
  const std::size_t d = set_.dimension();
  std::size_t at_limit = 0;
  for (std::size_t k = 0; k < working_.size(); ++k) {
    const double upper = constraints_.upper_of(working_.candidates()[k]);
    at_limit += working_.efforts()[k] >= (1.0 - 1e-6) * upper ? 1U : 0U;
  }
  const std::size_t wanted = std::max(2 * d, at_limit);
  std::size_t added = 0;
  for (const std::size_t k : violators(pool.sensitivities(), 0.0, wanted, 2 * wanted, random_)) {
    const std::size_t i = pool.candidate(k);
    added += working_.add(i, set_.information(i).data()) ? 1U : 0U;
  }
  return added;
}

bool ConstrainedRun::improve(double gap, double tolerance) {
  ++rounds_;
  const double target = std::max(0.3 * tolerance, std::min(0.3 * gap, gap * gap));
  const bool progress = working_.improve(gap, target);
  working_.drop(std::sqrt(std::min(gap, 1.0)));
  return progress;
}

void ConstrainedRun::solve_pool(CandidatePool& pool, double tolerance) {
  constexpr int kRoundLimit = 30;
  double last = kInfinity;
  for (int round = 0; round < kRoundLimit && !tracer_.out_of_time(); ++round) {
    const double gap = price(pool);
    if (gap <= tolerance) return;
    const std::size_t added = add_violators(pool);
    const bool improved = improve(gap, tolerance);
    if (added == 0 && (!improved || !(gap < last))) return;
    last = gap;
  }
}

CandidatePool ConstrainedRun::short_list(const CandidatePool& all) const {
  const std::size_t wanted = std::clamp(all.count / 16, std::size_t{512}, std::size_t{16384});
  double threshold = -std::numeric_limits<double>::max();
  if (all.count > 2 * wanted) {
    SensitivitySample sample(all.sensitivity.span());
    threshold = sample.exceeded_by(wanted);
  }
  CandidatePool list = pool_above(all, all.sensitivity.span(), threshold);
  // The members stay: the bound over the list needs all that are run.
  for (const std::size_t i : working_.candidates()) list.indices.push_back(i);
  std::ranges::sort(list.indices);
  const auto [first, last] = std::ranges::unique(list.indices);
  list.indices.erase(first, last);
  list.count = list.indices.size();
  list.sensitivity = AlignedArray(list.count);
  return list;
}

void ConstrainedRun::keep_if_better(double gap) {
  if (!(gap < best_gap_)) return;
  best_gap_ = gap;
  best_sharpness_ = working_.sharpness();
  best_multipliers_.assign(working_.multipliers().begin(), working_.multipliers().end());
  best_efforts_.assign(set_.candidate_count(), 0.0);
  for (std::size_t k = 0; k < working_.size(); ++k) {
    best_efforts_[working_.candidates()[k]] = working_.efforts()[k];
  }
}

ConstrainedSolution ConstrainedRun::finish(SolveStatus status, std::string message) {
  Solution counted = tracer_.finish({}, status, rounds_, std::move(message));
  return {.efforts = std::move(best_efforts_),
          .multipliers = std::move(best_multipliers_),
          .status = counted.status,
          .trace = std::move(counted.trace),
          .counters = counted.counters,
          .message = std::move(counted.message),
          .sharpness = best_sharpness_};
}

ConstrainedSolution ConstrainedRun::run() {
  const Start start = begin();
  if (start == Start::kInfeasible) {
    ConstrainedSolution none = finish(SolveStatus::kUnsupported, "no design obeys the constraints");
    none.infeasible = true;
    return none;
  }
  if (start == Start::kSingular) {
    return finish(SolveStatus::kUnsupported,
                  "prior and candidates together are singular: no design can estimate all "
                  "parameters");
  }
  improve(1.0, 0.1);
  if (!working_.regular()) {  // too few of low rank: the whole sample, which is regular, takes part
    for (const std::size_t i : sample_) working_.add(i, set_.information(i).data());
    improve(1.0, 0.1);
  }
  if (!working_.regular()) {
    return finish(SolveStatus::kNumericalFailure, "the first design is singular to rounding");
  }
  CandidatePool all = sample_pool(set_.candidate_count(), set_.candidate_count(), random_);
  double lowest = kInfinity;
  for (int without_progress = 0;;) {
    const double gap = price(all);
    tracer_.record(gap, rounds_);
    without_progress = gap < 0.9 * lowest ? 0 : without_progress + 1;
    lowest = std::min(lowest, gap);
    if (working_.regular() && working_.obeys_rows()) keep_if_better(gap);
    if (gap <= kShareOfGap * options_.duality_gap && working_.regular() && working_.obeys_rows()) {
      return finish(SolveStatus::kSolved);
    }
    if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
    if (options_.iteration_limit > 0 && rounds_ >= options_.iteration_limit) {
      return finish(SolveStatus::kIterationLimit);
    }
    if (without_progress > 8) {
      return finish(SolveStatus::kNumericalFailure,
                    fmt::format("rounding keeps the gap at {:.1e}", best_gap_));
    }
    CandidatePool list = short_list(all);
    add_violators(all);
    improve(gap, options_.duality_gap);
    solve_pool(list, std::max(0.3 * options_.duality_gap, 1e-2 * gap));
  }
}

// Coordinates in which rounding hides no more than `accuracy`; the set's own where the set alone is
// singular, which the prior may mend.
ConstrainedSolution run_conditioned(const InformationSet& set, const DesignConstraints& constraints,
                                    const SolveOptions& options, double accuracy, Tracer& tracer,
                                    bool& whitened) {
  std::optional<ConditionedSet> conditioned;
  try {
    conditioned.emplace(set, accuracy, tracer, options.threads);
  } catch (const InputError&) {
    if (constraints.prior.empty()) throw;
  }
  whitened = conditioned.has_value() && conditioned->whitened();
  if (!whitened) {
    return ConstrainedRun({set, {}, constraints.prior}, constraints, options, tracer).run();
  }
  std::vector<double> prior(constraints.prior.size());
  if (!prior.empty()) {
    (void)twofold_congruence(constraints.prior.data(), 1, set.dimension(),
                             conditioned->coordinates(), prior.data(), 1);
  }
  return ConstrainedRun({conditioned->set(), conditioned->coordinates(), std::move(prior)},
                        constraints, options, tracer)
      .run();
}

// The problem in x - l: what is required becomes part of the prior, and of what the rows have left.
DesignConstraints without_lower_limits(const InformationSet& set,
                                       const DesignConstraints& constraints) {
  DesignConstraints shifted = constraints;
  shifted.lower.clear();
  for (LinearConstraint& row : shifted.rows) {
    const double used = row_value(row, constraints.lower);
    const bool equation = row.lower == row.upper;
    row.lower -= used;
    row.upper = equation ? row.lower : row.upper - used;
  }
  if (shifted.prior.empty()) shifted.prior.assign(set.packed_size(), 0.0);
  for (std::size_t i = 0; i < constraints.lower.size(); ++i) {
    const double required = constraints.lower[i];
    if (required == 0.0) continue;
    const auto h = set.information(i);
    for (std::size_t k = 0; k < h.size(); ++k) shifted.prior[k] += required * h[k];
    if (!shifted.upper.empty()) shifted.upper[i] -= required;
  }
  return shifted;
}

ConstrainedSolution solve_without_lower_limits(const InformationSet& set,
                                               const DesignConstraints& constraints,
                                               const SolveOptions& options,
                                               SolveObserver* observer) {
  constexpr double kToleratedError = 0.1;  // of the sensitivities, as a share of the gap
  Tracer tracer(set, options, observer);
  bool whitened = false;
  ConstrainedSolution solution = run_conditioned(
      set, constraints, options, kToleratedError * options.duality_gap, tracer, whitened);
  if (solution.status != SolveStatus::kNumericalFailure || whitened) return solution;
  ConstrainedSolution again = run_conditioned(
      set, constraints, options, kSensitivityAccuracy * options.duality_gap, tracer, whitened);
  return whitened ? again : solution;
}

ConstrainedSolution infeasible() {
  ConstrainedSolution none;
  none.status = SolveStatus::kUnsupported;
  none.message = "no design obeys the constraints";
  none.infeasible = true;
  return none;
}

// Where all of the effort is required there is one design.
ConstrainedSolution only_design(const DesignConstraints& constraints) {
  if (largest_violation(constraints, constraints.lower) > 1e-12) return infeasible();
  return {.efforts = constraints.lower,
          .multipliers = {},
          .status = SolveStatus::kSolved,
          .trace = {},
          .counters = {},
          .message = "the required experiments use all of the effort",
          .sharpness = 1.0};
}

}  // namespace

ConstrainedSolution try_constrained(const InformationSet& set, const DesignConstraints& constraints,
                                    const SolveOptions& options, SolveObserver* observer) {
  if (constraints.lower.empty()) {
    return solve_without_lower_limits(set, constraints, options, observer);
  }
  const DesignConstraints shifted = without_lower_limits(set, constraints);
  const double left = shifted.rows.front().upper, total = constraints.rows.front().upper;
  if (left < -1e-12 * total) return infeasible();
  if (left <= 1e-12 * total) return only_design(constraints);
  ConstrainedSolution solution = solve_without_lower_limits(set, shifted, options, observer);
  for (std::size_t i = 0; i < solution.efforts.size(); ++i) {
    solution.efforts[i] += constraints.lower[i];
  }
  return solution;
}

ConstrainedSolution solve_constrained(const InformationSet& set,
                                      const DesignConstraints& constraints,
                                      const SolveOptions& options, SolveObserver* observer) {
  options.criterion.require_fits(set);
  require_fits(constraints, set);
  SolveOptions with_region = options;
  with_region.criterion = over_candidates(options.criterion, set);
  ConstrainedSolution solution = try_constrained(set, constraints, with_region, observer);
  if (solution.infeasible) throw_contradiction(constraints);
  return solution;
}

}  // namespace graybox
