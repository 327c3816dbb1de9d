#include "solvers/core/candidate_blocks.hpp"

#include <fmt/format.h>

#include <cmath>

#include "problems/base/error.hpp"

namespace graybox {

CandidateBlocks equal_blocks(std::size_t candidates, std::size_t size) {
  if (size == 0 || candidates % size != 0) {
    throw InputError(
        fmt::format("blocks: {} candidates can't be split into blocks of {}", candidates, size));
  }
  CandidateBlocks blocks{candidates / size, std::vector<std::uint32_t>(candidates)};
  for (std::size_t i = 0; i < candidates; ++i) {
    blocks.label[i] = static_cast<std::uint32_t>(i / size);
  }
  return blocks;
}

void check_blocks(const InformationSet& set, const CandidateBlocks& blocks) {
  if (blocks.label.size() != set.candidate_count()) {
    throw InputError(fmt::format("blocks: {} labels for {} candidates", blocks.label.size(),
                                 set.candidate_count()));
  }
  std::vector<bool> seen(blocks.count, false);
  for (const std::uint32_t block : blocks.label) {
    if (block >= blocks.count) {
      throw InputError(fmt::format("blocks: label {} of {} blocks", block, blocks.count));
    }
    seen[block] = true;
  }
  for (std::size_t b = 0; b < blocks.count; ++b) {
    if (!seen[b]) throw InputError(fmt::format("blocks: block {} has no candidate", b));
  }
}

void check_block_limit(const CandidateBlocks& blocks, double limit) {
  constexpr double kFreedom = 1e-6;
  if (!(limit > 0.0) || !std::isfinite(limit)) {
    throw InputError(fmt::format("limit: the share of a block must be positive, is {}", limit));
  }
  const auto count = static_cast<double>(blocks.count);
  if (!(limit * count > 1.0 + kFreedom)) {
    throw InputError(fmt::format(
        "limit: {} blocks with at most {:.6g} of the weight each can't share it freely; "
        "the limit must exceed 1/{} = {:.6g}",
        blocks.count, limit, blocks.count, 1.0 / count));
  }
}

BlockMembers::BlockMembers(const CandidateBlocks& blocks)
    : first(blocks.count + 1, 0), members(blocks.label.size()) {
  for (const std::uint32_t block : blocks.label) ++first[block + 1];
  for (std::size_t b = 0; b < blocks.count; ++b) first[b + 1] += first[b];
  std::vector<std::size_t> next(first.begin(), first.end() - 1);
  for (std::size_t i = 0; i < members.size(); ++i) members[next[blocks.label[i]]++] = i;
}

std::vector<double> block_shares(const CandidateBlocks& blocks, std::span<const double> weights) {
  std::vector<double> shares(blocks.count, 0.0);
  for (std::size_t i = 0; i < weights.size(); ++i) shares[blocks.label[i]] += weights[i];
  return shares;
}

}  // namespace graybox
