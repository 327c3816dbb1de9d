#include "solvers/column_generation/well_conditioned_start.hpp"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/core/inverse_cholesky.hpp"

namespace graybox {
namespace {

constexpr int kSteps = 4;             // multiplicative steps on the pool
constexpr double kLargestLoss = 8.0;  // of tr(S^-1 P) / d

// Candidates of the set with their weights after the multiplicative steps.
class WeightedPool {
 public:
  WeightedPool(const InformationSet& set, std::vector<std::size_t> candidates)
      : set_(set), candidates_(std::move(candidates)), rows_(candidates_.size() * p()) {
    for (std::size_t k = 0; k < candidates_.size(); ++k) {
      const std::span<double> row = rows_.span().subspan(k * p(), p());
      const auto packed = set_.packed(candidates_[k], row);
      if (packed.data() != row.data()) std::ranges::copy(packed, row.begin());
    }
  }

  [[nodiscard]] bool weigh(bool equalise, Random& random, Tracer& tracer);
  // The weights given instead, one for each candidate of the pool.
  void take_weights(std::vector<double> weights, Tracer& tracer);
  [[nodiscard]] bool choose(WorkingSet& working);
  [[nodiscard]] bool take_all(WorkingSet& working) const;

 private:
  [[nodiscard]] std::size_t p() const { return set_.packed_size(); }
  [[nodiscard]] double size_of(std::size_t k) const;
  [[nodiscard]] std::vector<std::size_t> heaviest(std::size_t wanted);
  [[nodiscard]] std::vector<std::size_t> heaviest_of_stretches(std::size_t wanted) const;
  [[nodiscard]] bool take(const std::vector<std::size_t>& positions, WorkingSet& working) const;

  const InformationSet& set_;
  std::vector<std::size_t> candidates_;
  AlignedArray rows_;
  std::vector<double> weights_;
  std::vector<double> matrix_;      // P
  std::vector<std::size_t> order_;  // positions, partly sorted by weight
};

double WeightedPool::size_of(std::size_t k) const {
  double trace = 0.0;
  for (std::size_t j = 0; j < set_.dimension(); ++j) {
    trace += rows_[k * p() + packed_index(j, j)];
  }
  return trace;
}

bool WeightedPool::weigh(bool equalise, Random& random, Tracer& tracer) {
  const std::size_t count = candidates_.size();
  weights_.resize(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double size = equalise ? size_of(k) : 1.0;
    weights_[k] = (0.9 + 0.2 * random.uniform()) / (size > 0.0 ? size : 1.0);
  }
  tracer.count_candidates(count);
  matrix_.assign(p(), 0.0);
  kernels().accumulate(rows_.data(), count, p(), weights_.data(), matrix_.data());
  InverseCholesky inverse(set_.dimension());
  std::vector<double> sensitivity(count);
  for (int step = 0; step < kSteps; ++step) {
    if (!inverse.factor(matrix_)) return false;
    std::ranges::fill(matrix_, 0.0);
    kernels().reweigh(rows_.data(), count, p(), inverse.trace_dual().data(),
                      1.0 / static_cast<double>(set_.dimension()), weights_.data(),
                      sensitivity.data(), matrix_.data());
    tracer.count_candidates(count);
  }
  return true;
}

void WeightedPool::take_weights(std::vector<double> weights, Tracer& tracer) {
  weights_ = std::move(weights);
  matrix_.assign(p(), 0.0);
  kernels().accumulate(rows_.data(), candidates_.size(), p(), weights_.data(), matrix_.data());
  tracer.count_candidates(candidates_.size());
}

std::vector<std::size_t> WeightedPool::heaviest(std::size_t wanted) {
  if (order_.empty()) {
    order_.resize(candidates_.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
  }
  const auto middle = order_.begin() + static_cast<std::ptrdiff_t>(wanted - 1);
  std::ranges::nth_element(order_, middle,
                           [&](std::size_t a, std::size_t b) { return weights_[a] > weights_[b]; });
  return {order_.begin(), middle + 1};
}

std::vector<std::size_t> WeightedPool::heaviest_of_stretches(std::size_t wanted) const {
  const std::size_t count = candidates_.size();
  std::vector<std::size_t> positions(wanted);
  for (std::size_t k = 0; k < wanted; ++k) {
    const auto from = weights_.begin() + static_cast<std::ptrdiff_t>(count * k / wanted);
    const auto to = weights_.begin() + static_cast<std::ptrdiff_t>(count * (k + 1) / wanted);
    positions[k] = static_cast<std::size_t>(std::max_element(from, to) - weights_.begin());
  }
  return positions;
}

// The working set of these positions; true where it passes the test.
bool WeightedPool::take(const std::vector<std::size_t>& positions, WorkingSet& working) const {
  working.clear();
  for (const std::size_t k : positions) {
    const std::size_t i = candidates_[k];
    working.add(i, rows_.data() + k * p(), weights_[k]);
  }
  if (!working.refresh()) return false;
  const auto dual = working.inverse().trace_dual();
  const double tau = std::inner_product(dual.begin(), dual.end(), matrix_.begin(), 0.0);
  return tau <= kLargestLoss * static_cast<double>(set_.dimension());
}

bool WeightedPool::choose(WorkingSet& working) {
  const std::size_t count = candidates_.size();
  for (std::size_t wanted = 3 * set_.dimension(); wanted < count; wanted *= 2) {
    if (take(heaviest(wanted), working)) return true;
    if (take(heaviest_of_stretches(wanted), working)) return true;
  }
  return take_all(working);
}

bool WeightedPool::take_all(WorkingSet& working) const {
  std::vector<std::size_t> all(candidates_.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  static_cast<void>(take(all, working));  // it is the pool: nothing is lost
  return working.refresh();
}

bool start_from(const InformationSet& set, std::vector<std::size_t> candidates, bool equalise,
                Random& random, Tracer& tracer, WorkingSet& working) {
  WeightedPool pool(set, std::move(candidates));
  return pool.weigh(equalise, random, tracer) && pool.choose(working);
}

}  // namespace

bool well_conditioned_start(const InformationSet& set, const CandidatePool& pool, Random& random,
                            Tracer& tracer, WorkingSet& working) {
  std::vector<std::size_t> candidates(pool.count);
  for (std::size_t k = 0; k < pool.count; ++k) candidates[k] = pool.candidate(k);
  if (start_from(set, candidates, false, random, tracer, working)) return true;
  require_memory(set.candidate_count() * set.packed_size() * sizeof(double),
                 set.name() + ": a start from all candidates", "use a part of the set");
  candidates.resize(set.candidate_count());
  std::iota(candidates.begin(), candidates.end(), std::size_t{0});
  return start_from(set, candidates, false, random, tracer, working) ||
         start_from(set, candidates, true, random, tracer, working);
}

bool start_from_design(const InformationSet& set, std::span<const double> weights, Tracer& tracer,
                       WorkingSet& working) {
  std::vector<std::size_t> support;
  std::vector<double> positive;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (!(weights[i] > 0.0)) continue;
    support.push_back(i);
    positive.push_back(weights[i]);
  }
  const bool is_short = support.size() <= set.packed_size() + 1;
  WeightedPool pool(set, std::move(support));
  pool.take_weights(std::move(positive), tracer);
  return is_short ? pool.take_all(working) : pool.choose(working);
}

}  // namespace graybox
