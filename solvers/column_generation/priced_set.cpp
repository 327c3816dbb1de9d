#include "solvers/column_generation/priced_set.hpp"

#include <algorithm>
#include <utility>

#include "solvers/pricing/candidate_pricer.hpp"

namespace graybox {
namespace {

// Runs of factors are as many bytes long as those of matrices of usual size.
std::size_t longest_run(const InformationSet& set) {
  constexpr std::size_t kNumbers = 4992, kMost = 512;
  if (!set.has_factors()) return StagedOrder::kUsualRun;
  return std::clamp(kNumbers / (set.rank() * set.dimension()), StagedOrder::kUsualRun, kMost);
}

constexpr double kFew = 0.4;  // scattered rows take up to twice the time of a pass's

}  // namespace

PricedSet::PricedSet(const InformationSet& set, int threads, Random& random)
    : set_(set), threads_(threads), order_(set.candidate_count(), random, longest_run(set)) {
  all_.count = set.candidate_count();
  all_.sensitivity = AlignedArray(all_.count);
}

void PricedSet::price(const WorkingSet& design) {
  price_pool(set_, design.inverse(), threads_, all_);
  bounds_.assign(stages(), LazyBound(design));
}

std::size_t PricedSet::price_stage(std::size_t stage, const WorkingSet& design) {
  if (stage == 0) bounds_.clear();
  bounds_.emplace_back(design);
  const auto runs = static_cast<std::ptrdiff_t>(order_.runs(stage));
  std::size_t count = 0;
#pragma omp parallel num_threads(threads_) reduction(+ : count) if (threads_ > 1)
  {
    CandidatePricer pricer(set_, design.inverse());
#pragma omp for schedule(static)
    for (std::ptrdiff_t k = 0; k < runs; ++k) {
      const CandidateRun run = order_.run(stage, static_cast<std::size_t>(k));
      pricer.price(run.from, run.to - run.from, all_.sensitivity.data() + run.from);
      count += run.to - run.from;
    }
  }
  return count;
}

std::size_t PricedSet::count_above(CandidateRun run, double threshold) const {
  const double* w = all_.sensitivity.data();
  std::size_t count = 0;
  for (std::size_t i = run.from; i < run.to; ++i) count += w[i] >= threshold ? 1U : 0U;
  return count;
}

// Most runs have none, and are looked at once.
void PricedSet::collect(CandidateRun run, double threshold,
                        std::vector<std::size_t>& indices) const {
  if (count_above(run, threshold) == 0) return;
  for (std::size_t i = run.from; i < run.to; ++i) {
    if (all_.sensitivity[i] >= threshold) indices.push_back(i);
  }
}

CandidatePool PricedSet::pool_of(std::vector<std::size_t> indices) const {
  CandidatePool found;
  found.count = indices.size();
  found.sensitivity = AlignedArray(found.count);
  for (std::size_t k = 0; k < found.count; ++k) {
    found.sensitivity[k] = all_.sensitivity[indices[k]];
    if (found.sensitivity[k] > found.sensitivity[found.best]) found.best = k;
  }
  found.indices = std::move(indices);
  return found;
}

CandidatePool PricedSet::high(std::size_t stage, double threshold) const {
  std::vector<std::size_t> indices;
  for (std::size_t k = 0; k < order_.runs(stage); ++k) {
    collect(order_.run(stage, k), threshold, indices);
  }
  return pool_of(std::move(indices));
}

std::optional<CandidatePool> PricedSet::open(const WorkingSet& design, double level) const {
  if (bounds_.size() < stages()) return std::nullopt;
  std::vector<double> thresholds;
  for (const LazyBound& bound : bounds_) thresholds.push_back(bound.threshold(design, level));
  const double few = kFew * static_cast<double>(all_.count);
  std::vector<std::size_t> indices;
  for (std::size_t r = 0; r < order_.run_count(); ++r) {
    collect(order_.run(r), thresholds[order_.stage_of_run(r)], indices);
    if (static_cast<double>(indices.size()) > few) return std::nullopt;
  }
  if (indices.empty()) return std::nullopt;
  return pool_of(std::move(indices));
}

}  // namespace graybox
