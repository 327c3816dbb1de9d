#include "solvers/blocks/block_limited_column_generation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "problems/kernels/kernels.hpp"
#include "solvers/blocks/block_limited_certificate.hpp"
#include "solvers/blocks/block_limited_working_set.hpp"
#include "solvers/column_generation/best_design.hpp"
#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/pricing/candidate_pool.hpp"
#include "solvers/pricing/sensitivity_sample.hpp"

namespace graybox {
namespace {

class BlockLimitedRun {
 public:
  BlockLimitedRun(const InformationSet& set, const CandidateBlocks& blocks, double limit,
                  const SolveOptions& options, Tracer& tracer)
      : set_(set),
        blocks_(blocks),
        limit_(limit),
        options_(options),
        tracer_(tracer),
        working_(set.dimension(), blocks.count, limit),
        random_(options.seed),
        dimension_(static_cast<double>(set.dimension())),
        block_maxima_(blocks.count) {}

  Solution run();

 private:
  // A few more blocks than the limit asks for, so that the first working sets have a choice.
  [[nodiscard]] std::size_t blocks_wanted() const {
    return std::min(blocks_.count, static_cast<std::size_t>(1.2 / limit_) + 2 * set_.dimension());
  }
  [[nodiscard]] bool start(const CandidatePool& pool);
  void add_heaviest(const CandidatePool& pool, const std::vector<double>& weights,
                    std::size_t wanted);
  void add(std::size_t candidate) {
    working_.add(candidate, blocks_.label[candidate], set_.information(candidate).data());
  }
  [[nodiscard]] bool warm_up();
  void price(CandidatePool& pool);
  [[nodiscard]] double reduce(CandidatePool& pool) const;
  [[nodiscard]] double limited_gap(const CandidatePool& all);
  std::size_t add_violators(const CandidatePool& pool);
  [[nodiscard]] bool improve(double gap, double tolerance);
  [[nodiscard]] bool solve_pool(CandidatePool& pool, double tolerance, int round_limit);
  [[nodiscard]] CandidatePool short_list(const CandidatePool& all) const;
  [[nodiscard]] bool out_of_rounds() const {
    return options_.iteration_limit > 0 && rounds_ >= options_.iteration_limit;
  }
  Solution finish(SolveStatus status, std::string message = {});

  const InformationSet& set_;
  const CandidateBlocks& blocks_;
  double limit_;
  const SolveOptions& options_;
  Tracer& tracer_;
  BlockLimitedWorkingSet working_;
  Random random_;
  double dimension_;
  std::vector<double> block_maxima_;
  std::int64_t rounds_ = 0;
  BestDesign best_;
};

// The first working set: the heaviest candidates after a few multiplicative steps on the pool from
// random positive weights, which break ties. False where their matrix stays singular.
bool BlockLimitedRun::start(const CandidatePool& pool) {
  constexpr int kSteps = 4;
  const std::size_t p = set_.packed_size(), count = pool.count;
  AlignedArray copies(pool.whole() ? 0 : count * p);
  for (std::size_t k = 0; k < (pool.whole() ? 0 : count); ++k) {
    std::ranges::copy(set_.information(pool.candidate(k)), copies.begin() + k * p);
  }
  const double* rows = pool.whole() ? set_.data() : copies.data();
  std::vector<double> weights(count), matrix(p, 0.0), sensitivity(count);
  for (double& weight : weights) weight = 0.9 + 0.2 * random_.uniform();
  kernels().accumulate(rows, count, p, weights.data(), matrix.data());
  tracer_.count_candidates(count);
  InverseCholesky inverse(set_.dimension());
  for (int step = 0; step < kSteps; ++step) {
    if (!inverse.factor(matrix)) return false;
    std::ranges::fill(matrix, 0.0);
    kernels().reweigh(rows, count, p, inverse.trace_dual().data(), 1.0 / dimension_, weights.data(),
                      sensitivity.data(), matrix.data());
    tracer_.count_candidates(count);
  }
  for (std::size_t wanted = 3 * set_.dimension();; wanted *= 2) {
    add_heaviest(pool, weights, wanted);
    if (working_.feasible() && working_.optimise(1.0, 1.0)) return true;
    if (wanted >= count) return false;
  }
}

// The `wanted` heaviest candidates, then the heaviest of other blocks until there are enough
// blocks.
void BlockLimitedRun::add_heaviest(const CandidatePool& pool, const std::vector<double>& weights,
                                   std::size_t wanted) {
  std::vector<std::size_t> order(pool.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) {
    return weights[a] != weights[b] ? weights[a] > weights[b] : a < b;
  });
  std::vector<bool> occurs(blocks_.count, false);
  std::size_t taken = 0, occurring = 0;
  for (const std::size_t k : order) {
    const std::size_t candidate = pool.candidate(k);
    const bool is_new = !occurs[blocks_.label[candidate]];
    if (taken >= wanted && !(is_new && occurring < blocks_wanted())) continue;
    occurs[blocks_.label[candidate]] = true;
    occurring += is_new ? 1U : 0U;
    ++taken;
    add(candidate);
  }
}

void BlockLimitedRun::price(CandidatePool& pool) {
  price_pool(set_, working_.inverse().trace_dual(), options_.threads, pool);
  tracer_.count_candidates(pool.count);
}

// From w_i to w_i - kappa_b(i). Returns an upper bound of the gap on the pool, by weak duality.
double BlockLimitedRun::reduce(CandidatePool& pool) const {
  const auto prices = working_.prices();
  for (std::size_t k = 0; k < pool.count; ++k) {
    pool.sensitivity[k] -= prices[blocks_.label[pool.candidate(k)]];
  }
  pool.best = static_cast<std::size_t>(
      std::max_element(pool.sensitivity.begin(), pool.sensitivity.begin() + pool.count) -
      pool.sensitivity.begin());
  return (pool.largest() + limit_ * working_.price_sum()) / dimension_ - 1.0;
}

// The gap of the design, from w_i of the whole set.
double BlockLimitedRun::limited_gap(const CandidatePool& all) {
  std::ranges::fill(block_maxima_, 0.0);
  for (std::size_t k = 0; k < all.count; ++k) {
    double& largest = block_maxima_[blocks_.label[k]];
    largest = std::max(largest, all.sensitivity[k]);
  }
  return largest_limited_mean(std::span(block_maxima_), limit_) / dimension_ - 1.0;
}

// The better half of some dozens of stretches. Small limits need many blocks.
std::size_t BlockLimitedRun::add_violators(const CandidatePool& pool) {
  const std::size_t stretches =
      std::min(pool.count, 4 * set_.dimension() + static_cast<std::size_t>(1.0 / limit_));
  const std::size_t before = working_.size();
  for (const std::size_t k :
       violators(pool.sensitivities(), working_.level(), (stretches + 1) / 2, stretches, random_)) {
    add(pool.candidate(k));
  }
  return working_.size() - before;
}

// Solves the working set a good deal more precisely than the gap of the last pricing.
bool BlockLimitedRun::improve(double gap, double tolerance) {
  ++rounds_;
  if (!working_.optimise(gap, std::max(0.3 * tolerance, std::min(0.1 * gap, gap * gap))))
    return false;
  working_.drop_idle(dimension_ * std::sqrt(std::max(gap, 0.0) + working_.gap()));
  return true;
}

// Rounds of price, add, solve on one pool until its gap is at most `tolerance`. False where the
// working set can't be solved.
bool BlockLimitedRun::solve_pool(CandidatePool& pool, double tolerance, int round_limit) {
  for (int round = 0; round < round_limit && !out_of_rounds() && !tracer_.out_of_time(); ++round) {
    price(pool);
    const double gap = reduce(pool);
    if (gap <= tolerance || add_violators(pool) == 0) return true;
    if (!improve(gap, tolerance)) return false;
  }
  return true;
}

bool BlockLimitedRun::warm_up() {
  constexpr double kRoughGap = 0.03;
  const std::size_t total = set_.candidate_count();
  const std::size_t first =
      std::max(std::clamp(total / 16, std::size_t{1024}, std::size_t{4096}), 2 * blocks_wanted());
  CandidatePool sample = sample_pool(total, first, random_);
  if (!start(sample) && (sample.whole() || !start(sample_pool(total, total, random_)))) {
    return false;
  }
  if (!solve_pool(sample, kRoughGap, 4)) return false;
  for (std::size_t size = 16 * first; size * 4 < total; size *= 16) {
    sample = sample_pool(total, size, random_);
    if (!solve_pool(sample, kRoughGap, 3)) return false;
  }
  return true;
}

Solution BlockLimitedRun::run() {
  constexpr int kPatience = 8;
  if (!warm_up()) {
    return finish(SolveStatus::kUnsupported,
                  "no regular information matrix within the limits in double precision");
  }
  CandidatePool all = sample_pool(set_.candidate_count(), set_.candidate_count(), random_);
  for (int without_progress = 0;;) {
    price(all);
    const double gap = limited_gap(all);
    tracer_.record(gap, rounds_);
    without_progress = gap < 0.9 * best_.gap() ? 0 : without_progress + 1;
    best_.offer(gap, working_.indices(), working_.weights());
    if (gap <= options_.duality_gap) return finish(SolveStatus::kSolved);
    if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
    if (out_of_rounds()) return finish(SolveStatus::kIterationLimit);
    if (without_progress > kPatience) break;
    (void)reduce(all);
    CandidatePool list = short_list(all);
    add_violators(all);
    if (!improve(gap, options_.duality_gap) || !solve_pool(list, 0.5 * options_.duality_gap, 40)) {
      break;
    }
  }
  return finish(SolveStatus::kNumericalFailure,
                fmt::format("rounding keeps the gap at {:.1e}", best_.gap()));
}

// About as many as are wanted of the largest reduced sensitivities; the threshold is a quantile of
// a sample. The next pass over the set corrects what they leave out.
CandidatePool BlockLimitedRun::short_list(const CandidatePool& all) const {
  const std::size_t wanted = std::clamp(all.count / 64, std::size_t{512}, std::size_t{32768});
  const auto values = all.sensitivity.span();
  const double threshold = all.count <= 2 * wanted ? -std::numeric_limits<double>::infinity()
                                                   : SensitivitySample(values).exceeded_by(wanted);
  return pool_above(all, values, std::min(threshold, all.largest()));
}

Solution BlockLimitedRun::finish(SolveStatus status, std::string message) {
  Design design;
  if (best_.empty()) status = SolveStatus::kUnsupported;
  if (status != SolveStatus::kUnsupported) design = best_.design(set_.candidate_count());
  return tracer_.finish(std::move(design), status, rounds_, std::move(message));
}

}  // namespace

Solution solve_block_limited(const InformationSet& set, const CandidateBlocks& blocks, double limit,
                             const SolveOptions& options, SolveObserver* observer) {
  check_blocks(set, blocks);
  check_block_limit(blocks, limit);
  Tracer tracer(set, options, observer);
  Solution solution = BlockLimitedRun(set, blocks, limit, options, tracer).run();
  if (solution.status != SolveStatus::kNumericalFailure &&
      solution.status != SolveStatus::kUnsupported) {
    return solution;
  }
  const ConditionedSet conditioned(set, kSensitivityAccuracy * options.duality_gap, tracer);
  if (!conditioned.whitened()) return solution;
  return BlockLimitedRun(conditioned.set(), blocks, limit, options, tracer).run();
}

}  // namespace graybox
