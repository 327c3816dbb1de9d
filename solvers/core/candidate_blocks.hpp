// CandidateBlocks: a partition of the candidates of a set, for designs that treat candidates of one
// block together: the lines of a spectrum in one position of a robot, the points of one batch.
//
//   const CandidateBlocks blocks = equal_blocks(set.candidate_count(), line_count(robot));
//   const std::vector<double> shares = block_shares(blocks, design.weights);   // tau_b
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

struct CandidateBlocks {
  std::size_t count = 0;             // blocks, B
  std::vector<std::uint32_t> label;  // the block of each candidate, below B
};

// Consecutive blocks of `size` candidates. Throws InputError unless size divides the count.
[[nodiscard]] CandidateBlocks equal_blocks(std::size_t candidates, std::size_t size);

// Throws InputError unless there is one label for each candidate, all of them below the count, and
// no block is empty.
void check_blocks(const InformationSet& set, const CandidateBlocks& blocks);

// Throws InputError where the limit is not a positive number, or so small that the blocks together
// can't hold a weight of one with any freedom: c B must exceed 1 by more than 1e-6.
void check_block_limit(const CandidateBlocks& blocks, double limit);

// The candidates of each block in order: block b has members[first[b]] to members[first[b + 1] -
// 1].
struct BlockMembers {
  explicit BlockMembers(const CandidateBlocks& blocks);
  [[nodiscard]] std::span<const std::size_t> of(std::size_t block) const {
    return {members.data() + first[block], first[block + 1] - first[block]};
  }

  std::vector<std::size_t> first;
  std::vector<std::size_t> members;
};

// sum of the weights in each block.
[[nodiscard]] std::vector<double> block_shares(const CandidateBlocks& blocks,
                                               std::span<const double> weights);

}  // namespace graybox
