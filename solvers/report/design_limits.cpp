#include "solvers/report/design_limits.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "problems/base/error.hpp"
#include "solvers/core/candidate_blocks.hpp"

namespace graybox {
namespace {

CandidateBlocks blocks_of(const InformationSet& set, const BlockShareLimit& limit) {
  return equal_blocks(set.candidate_count(), limit.block_size);
}

void require_fits(const ConcentrationLimit& limit, const InformationSet& set) {
  const std::size_t count = set.candidate_count();
  if (limit.positions < 1 || limit.positions > count) {
    throw InputError(
        fmt::format("limits.concentration.positions must be from 1 to the {} candidates, is {}",
                    count, limit.positions));
  }
  const double uniform = static_cast<double>(limit.positions) / static_cast<double>(count);
  if (!(limit.share >= uniform && limit.share <= 1.0)) {
    throw InputError(fmt::format(
        "limits.concentration.largest_share must be from {:.6g}, the share of {} candidates in the "
        "uniform design, to 1, is {}",
        uniform, limit.positions, limit.share));
  }
}

}  // namespace

void require_fits(const DesignLimits& limits, const InformationSet& set) {
  if (limits.concentration.has_value() && limits.block_share.has_value()) {
    throw InputError(
        "limits: concentration and block_share together have no certificate; name one");
  }
  if (limits.concentration.has_value()) require_fits(*limits.concentration, set);
  if (limits.block_share.has_value()) {
    check_block_limit(blocks_of(set, *limits.block_share), limits.block_share->share);
  }
}

std::string describe(const DesignLimits& limits) {
  if (limits.concentration.has_value()) {
    return fmt::format("at most {:g} of the weight in any {} candidates",
                       limits.concentration->share, limits.concentration->positions);
  }
  if (limits.block_share.has_value()) {
    return fmt::format("at most {:g} of the weight in each block of {} candidates",
                       limits.block_share->share, limits.block_share->block_size);
  }
  return "no limits";
}

nlohmann::ordered_json to_json(const DesignLimits& limits) {
  nlohmann::ordered_json root;
  if (limits.concentration.has_value()) {
    root["concentration"] = {{"largest_share", limits.concentration->share},
                             {"positions", limits.concentration->positions}};
  }
  if (limits.block_share.has_value()) {
    root["block_share"] = {{"largest_share", limits.block_share->share},
                           {"block_size", limits.block_share->block_size}};
  }
  return root;
}

}  // namespace graybox
