// How many experiments each block takes (block_effects.hpp), in words:
//
//   "4, 4, 4"      four in each of three blocks
//   "3-5, 3-5, 4"  from three to five in two of them
//
// The set says with its coordinate `block`, counted from one, which block a candidate belongs to.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/constrained/design_constraints.hpp"

namespace graybox {

// Their sum, where each is one number. Throws InputError where the text is no such list.
[[nodiscard]] std::optional<double> experiments_in_blocks(std::string_view text);

// A row a block, named "block 1". Throws InputError as above, where the set has no coordinate
// `block`, and where the number of sizes is not that of its blocks.
[[nodiscard]] std::vector<LinearConstraint> block_size_rows(const InformationSet& set,
                                                            std::string_view text);

}  // namespace graybox
