#include "solvers/blocks/block_designs.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "solvers/blocks/block_limited_certificate.hpp"
#include "solvers/blocks/block_limited_column_generation.hpp"
#include "solvers/blocks/two_step_design.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"

namespace graybox {
namespace {

// All but design and gap.
BlockDesign outcome(std::string name, const Solution& solution) {
  BlockDesign result;
  result.name = std::move(name);
  result.status = solution.status;
  result.counters = solution.counters;
  result.message = solution.message;
  return result;
}

}  // namespace

BlockDesign flat_design(const InformationSet& set, const CandidateBlocks& blocks,
                        const SolveOptions& options, SolveObserver* observer) {
  const std::vector<double> inner = equal_inner_weights(blocks);
  const InformationSet mixture = mixed_blocks(set, blocks, inner, options.threads);
  const Solution solution = ColumnGeneration().solve(mixture, options, observer);
  BlockDesign result = outcome("flat", solution);
  if (solution.status == SolveStatus::kUnsupported) return result;
  result.design = expanded_design(blocks, solution.design.weights, inner);
  result.own_gap = certify(mixture, solution.design).duality_gap;
  return result;
}

BlockDesign blocks_first_design(const InformationSet& set, const CandidateBlocks& blocks,
                                const BlockDesign& flat, const SolveOptions& options,
                                SolveObserver* observer) {
  check_blocks(set, blocks);
  const std::vector<double> shares = block_shares(blocks, flat.design.weights);
  std::vector<std::size_t> members;
  for (std::size_t i = 0; i < flat.design.weights.size(); ++i) {
    if (shares[blocks.label[i]] > 0.0) members.push_back(i);
  }
  if (members.empty()) throw InputError("blocks_first: the design it starts from has no support");
  const InformationSet chosen = set.subset(members);
  const Solution solution = ColumnGeneration().solve(chosen, options, observer);
  BlockDesign result = outcome("blocks_first", solution);
  if (solution.status == SolveStatus::kUnsupported) return result;
  result.design.weights.assign(set.candidate_count(), 0.0);
  for (std::size_t k = 0; k < members.size(); ++k) {
    result.design.weights[members[k]] = solution.design.weights[k];
  }
  result.own_gap = certify(chosen, solution.design).duality_gap;
  return result;
}

BlockDesign two_step_block_design(const InformationSet& set, const CandidateBlocks& blocks,
                                  const SolveOptions& options, SolveObserver* observer) {
  TwoStepDesign two = two_step_design(set, blocks, options, observer);
  BlockDesign result = outcome("two_step", two.mixture);
  result.counters.seconds = two.seconds;
  if (two.mixture.status == SolveStatus::kUnsupported) return result;
  if (result.status == SolveStatus::kSolved && two.unsolved_blocks > 0) {
    result.status = SolveStatus::kNumericalFailure;
    result.message = "some blocks' own designs did not reach the gap";
  }
  const InformationSet mixture = mixed_blocks(set, blocks, two.inner, options.threads);
  result.own_gap =
      std::max(two.largest_inner_gap, certify(mixture, two.mixture.design).duality_gap);
  result.design = std::move(two.design);
  return result;
}

BlockDesign joint_design(const InformationSet& set, const CandidateBlocks& blocks,
                         const SolveOptions& options, double limit, SolveObserver* observer) {
  Solution solution = limit < 1.0 ? solve_block_limited(set, blocks, limit, options, observer)
                                  : ColumnGeneration().solve(set, options, observer);
  BlockDesign result = outcome("joint", solution);
  result.limit = std::min(limit, 1.0);
  if (solution.status == SolveStatus::kUnsupported) return result;
  result.design = std::move(solution.design);
  result.own_gap = limit < 1.0
                       ? certify_block_limited(set, result.design, blocks, limit).duality_gap
                       : certify(set, result.design).duality_gap;
  return result;
}

}  // namespace graybox
