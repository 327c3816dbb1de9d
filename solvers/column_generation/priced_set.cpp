#include "solvers/column_generation/priced_set.hpp"

#include <algorithm>
#include <limits>

#include "problems/kernels/kernels.hpp"

namespace graybox {
namespace {

constexpr double kFew = 0.4;  // scattered rows take up to twice the time of a pass's
constexpr double kNever = std::numeric_limits<double>::infinity();

}  // namespace

PricedSet::PricedSet(const InformationSet& set, int threads, Random& random)
    : set_(set), threads_(threads), order_(set.candidate_count(), random) {
  all_.count = set.candidate_count();
  all_.sensitivity = AlignedArray(all_.count);
}

void PricedSet::price(const WorkingSet& design) {
  price_pool(set_, design.inverse().trace_dual(), threads_, all_);
  bounds_.assign(stages(), LazyBound(design));
}

std::size_t PricedSet::price_stage(std::size_t stage, const WorkingSet& design) {
  if (stage == 0) bounds_.clear();
  bounds_.emplace_back(design);
  const std::size_t p = set_.packed_size();
  const auto runs = static_cast<std::ptrdiff_t>(order_.runs(stage));
  const double* dual = design.inverse().trace_dual().data();
  std::size_t count = 0;
#pragma omp parallel for num_threads(threads_) schedule(static) reduction(+ : count) \
    if (threads_ > 1)
  for (std::ptrdiff_t k = 0; k < runs; ++k) {
    const CandidateRun run = order_.run(stage, static_cast<std::size_t>(k));
    kernels().price(set_.data() + run.from * p, run.to - run.from, p, dual,
                    all_.sensitivity.data() + run.from);
    count += run.to - run.from;
  }
  return count;
}

std::size_t PricedSet::count_above(std::span<const double> thresholds) const {
  const double* w = all_.sensitivity.data();
  std::size_t count = 0;
  for (std::size_t r = 0; r < order_.run_count(); ++r) {
    const CandidateRun run = order_.run(r);
    const double threshold = thresholds[order_.stage_of_run(r)];
    for (std::size_t i = run.from; i < run.to; ++i) count += w[i] >= threshold ? 1U : 0U;
  }
  return count;
}

CandidatePool PricedSet::collect(std::span<const double> thresholds) const {
  CandidatePool found;
  found.count = count_above(thresholds);
  found.sensitivity = AlignedArray(found.count);
  found.indices.reserve(found.count);
  const double* w = all_.sensitivity.data();
  for (std::size_t r = 0; r < order_.run_count(); ++r) {
    const CandidateRun run = order_.run(r);
    const double threshold = thresholds[order_.stage_of_run(r)];
    for (std::size_t i = run.from; i < run.to; ++i) {
      if (!(w[i] >= threshold)) continue;
      if (w[i] > found.sensitivity[found.best] || found.indices.empty()) {
        found.best = found.indices.size();
      }
      found.sensitivity[found.indices.size()] = w[i];
      found.indices.push_back(i);
    }
  }
  return found;
}

CandidatePool PricedSet::high(std::size_t stage, double threshold) const {
  std::vector<double> thresholds(stages(), kNever);
  thresholds[stage] = threshold;
  return collect(thresholds);
}

std::optional<CandidatePool> PricedSet::open(const WorkingSet& design, double level) const {
  if (bounds_.size() < stages()) return std::nullopt;
  std::vector<double> thresholds;
  for (const LazyBound& bound : bounds_) thresholds.push_back(bound.threshold(design, level));
  const double few = kFew * static_cast<double>(all_.count);
  const std::size_t count = count_above(thresholds);
  if (count == 0 || static_cast<double>(count) > few) return std::nullopt;
  return collect(thresholds);
}

}  // namespace graybox
