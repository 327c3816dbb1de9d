// The certificate of design_limits.hpp. It needs solvers, which readers of designs do without.
#include "solvers/blocks/block_limited_certificate.hpp"
#include "solvers/core/candidate_blocks.hpp"
#include "solvers/report/design_limits.hpp"

namespace graybox {

Certificate certify_limited(const InformationSet& set, const Design& design,
                            const DesignLimits& limits) {
  require_fits(limits, set);
  if (limits.concentration.has_value()) {
    return certify_concentrated(set, design, *limits.concentration).certificate;
  }
  if (limits.block_share.has_value()) {
    return certify_block_limited(
        set, design, equal_blocks(set.candidate_count(), limits.block_share->block_size),
        limits.block_share->share);
  }
  return certify(set, design);
}

}  // namespace graybox
