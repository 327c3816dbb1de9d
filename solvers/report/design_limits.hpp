// DesignLimits: the limits that a design was made under, so that its file can say so and the
// checker hold it to them. One kind at a time, criterion D:
//
//   concentration   no more than the share alpha in any r candidates
//                   (robust/concentration_limit.hpp)
//   block share     no more than the share c in any block of consecutive candidates, all blocks of
//                   one size (block_limited_certificate.hpp)
//
// In a design file:
//
//   "limits": {"concentration": {"largest_share": 0.5, "positions": 79}}
//   "limits": {"block_share": {"largest_share": 0.1, "block_size": 288}}
//
// The certificate is that of the limited problem. The gap is the maximum over the designs that obey
// the limits of sum_i lambda'_i w_i / d - 1. This is a linear programme that a sorted fill (blocks)
// or the envelope of sorted means (concentration) solves exactly; proofs in the two headers above.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/core/design.hpp"
#include "solvers/robust/concentration_limit.hpp"

namespace graybox {

struct BlockShareLimit {
  double share = 1.0;          // c
  std::size_t block_size = 1;  // candidates
};

struct DesignLimits {
  std::optional<ConcentrationLimit> concentration = {};
  std::optional<BlockShareLimit> block_share = {};

  [[nodiscard]] bool any() const { return concentration.has_value() || block_share.has_value(); }
};

// Throws InputError for limits of both kinds, and for those that do not fit the set or leave no
// design.
void require_fits(const DesignLimits& limits, const InformationSet& set);

// One line without full stop: "at most 0.5 of the weight in any 79 candidates".
[[nodiscard]] std::string describe(const DesignLimits& limits);

// The certificate under the limits; a design that breaks them is kNotADesign. Without limits that
// of certify(). Throws as require_fits().
[[nodiscard]] Certificate certify_limited(const InformationSet& set, const Design& design,
                                          const DesignLimits& limits);

// The object "limits" of a design file. limits.any() must hold.
[[nodiscard]] nlohmann::ordered_json to_json(const DesignLimits& limits);

}  // namespace graybox
