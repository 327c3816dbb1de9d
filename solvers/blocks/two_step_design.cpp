#include "solvers/blocks/two_step_design.hpp"

#include <algorithm>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/core/tracer.hpp"

namespace graybox {
namespace {

struct InnerDesign {
  SolveStatus status = SolveStatus::kTimeLimit;  // of a block not reached
  double gap = 0.0;
};

InnerDesign solve_block(const InformationSet& set, std::span<const std::size_t> members,
                        const SolveOptions& options, std::span<double> inner) {
  Solution solution;
  try {
    solution = ColumnGeneration().solve(set.subset(members), options);
  } catch (const InputError&) {  // the sum of the block's matrices is singular
    solution.status = SolveStatus::kUnsupported;
  }
  if (solution.status == SolveStatus::kUnsupported) return {.status = solution.status};
  for (std::size_t k = 0; k < members.size(); ++k) {
    inner[members[k]] = solution.design.weights[k];
  }
  return {solution.status, solution.trace.back().duality_gap};
}

}  // namespace

InformationSet mixed_blocks(const InformationSet& set, const CandidateBlocks& blocks,
                            std::span<const double> inner, int threads) {
  check_blocks(set, blocks);
  const BlockMembers members(blocks);
  const std::size_t p = set.packed_size();
  AlignedArray information(blocks.count * p, 0.0);
  const auto count = static_cast<std::ptrdiff_t>(blocks.count);
#pragma omp parallel for num_threads(threads) schedule(static) if (threads > 1)
  for (std::ptrdiff_t b = 0; b < count; ++b) {
    double* sum = information.data() + static_cast<std::size_t>(b) * p;
    for (const std::size_t i : members.of(static_cast<std::size_t>(b))) {
      if (inner[i] == 0.0) continue;
      kernels().accumulate(set.information(i).data(), 1, p, inner.data() + i, sum);
    }
  }
  return InformationSet(set.dimension(), std::move(information), {}, set.parameters(), set.name());
}

std::vector<double> equal_inner_weights(const CandidateBlocks& blocks) {
  std::vector<double> size(blocks.count, 0.0);
  for (const std::uint32_t block : blocks.label) size[block] += 1.0;
  std::vector<double> inner(blocks.label.size());
  for (std::size_t i = 0; i < inner.size(); ++i) inner[i] = 1.0 / size[blocks.label[i]];
  return inner;
}

Design expanded_design(const CandidateBlocks& blocks, std::span<const double> shares,
                       std::span<const double> inner) {
  Design design{std::vector<double>(inner.size())};
  for (std::size_t i = 0; i < inner.size(); ++i) {
    design.weights[i] = shares[blocks.label[i]] * inner[i];
  }
  return design;
}

TwoStepDesign two_step_design(const InformationSet& set, const CandidateBlocks& blocks,
                              const SolveOptions& options, SolveObserver* observer) {
  check_blocks(set, blocks);
  Tracer tracer(set, options, observer);
  const BlockMembers members(blocks);
  TwoStepDesign result;
  result.inner = equal_inner_weights(blocks);
  std::vector<InnerDesign> inner(blocks.count);
  SolveOptions alone = options;
  alone.threads = 1;
  // Blocks go to the threads in batches; between batches one thread reports and asks to go on.
  constexpr std::size_t kBatch = 256;
  for (std::size_t from = 0; from < blocks.count && !tracer.out_of_time(); from += kBatch) {
    const auto to = static_cast<std::ptrdiff_t>(std::min(blocks.count, from + kBatch));
#pragma omp parallel for num_threads(options.threads) schedule(dynamic, 4) if (options.threads > 1)
    for (auto b = static_cast<std::ptrdiff_t>(from); b < to; ++b) {
      const auto block = static_cast<std::size_t>(b);
      inner[block] = solve_block(set, members.of(block), alone, result.inner);
    }
    for (std::size_t b = from; b < static_cast<std::size_t>(to); ++b) {
      const bool singular = inner[b].status == SolveStatus::kUnsupported;
      result.singular_blocks += singular ? 1U : 0U;
      if (!singular && inner[b].status != SolveStatus::kSolved) ++result.unsolved_blocks;
      result.largest_inner_gap = std::max(result.largest_inner_gap, inner[b].gap);
    }
    tracer.count_passes(static_cast<double>(static_cast<std::size_t>(to) - from) /
                        static_cast<double>(blocks.count));
    tracer.record(result.largest_inner_gap, to);
  }
  const bool stopped = tracer.out_of_time();
  const InformationSet mixture = mixed_blocks(set, blocks, result.inner, options.threads);
  result.mixture = ColumnGeneration().solve(mixture, options);
  if (stopped) result.mixture.status = SolveStatus::kTimeLimit;
  if (result.mixture.status != SolveStatus::kUnsupported) {
    result.design = expanded_design(blocks, result.mixture.design.weights, result.inner);
  }
  result.seconds = tracer.seconds();
  return result;
}

}  // namespace graybox
