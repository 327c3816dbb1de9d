// Blocks with effects of their own: days, batches of material, set-ups, operators.
//
// Each block of experiments has effects beta_b of its own. With block b the model of candidate i is
//
//   y = f_i(theta) + K_i beta_b + noise,       J = [ df_i/dtheta, 0, .., K_i, .., 0 ],
//
// K_i (r x q) in the columns of block b. The beta_b are nuisance: nobody wants to know them, but
// they have to be estimated too. Each candidate may be run in each block, so that Q candidates of d
// parameters become B Q candidates of d + B q; a design says how often which is run in which block.
// What it tells about theta is the Schur complement (Atkinson, Donev and Tobias 2007, chapter 15)
//
//   S = sum_b (J^T J - J^T K (K^T K)^-1 K^T J),   sums over the runs of block b,
//
// and criterion Ds with theta of interest makes its determinant large. Blocks that are not limited
// would all be merged into one: limit their sizes (design_request.hpp, block_sizes).
//
//   BlockEffects effects = offsets_of_outputs(jacobians, 3);        // three days
//   const InformationSet set =
//       information_set_from_jacobians(with_block_effects(std::move(jacobians), effects), noise);
//
// Cost: B Q r (d + B q) numbers.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "problems/information/jacobian_information.hpp"

namespace graybox {

struct BlockEffects {
  std::size_t blocks = 2;                         // B
  std::size_t effects = 1;                        // q
  std::vector<double> values = {};                // K: Q x r x q, row-major
  std::vector<std::string> names = {};            // of the effects; empty or q
  std::string source = "the effects of a block";  // for messages
};

// An offset of each output (q = r), and one offset of all outputs together (q = 1).
[[nodiscard]] BlockEffects offsets_of_outputs(const Jacobians& jacobians, std::size_t blocks);
[[nodiscard]] BlockEffects common_offset(const Jacobians& jacobians, std::size_t blocks);

// Candidate i in block b stands at b Q + i. Its coordinates are those of candidate i, or its number
// ("experiment") where there are none, and the block ("block", counted from one). The effects'
// parameters follow the model's as block_1.offset, block_2.offset, ...
//
// Throws InputError where sizes do not fit, there are fewer than two blocks, a number is not
// finite, or names are taken already. Likewise where columns of J and K depend on each other: a
// constant in J can't be told from an offset of each block.
[[nodiscard]] Jacobians with_block_effects(Jacobians jacobians, const BlockEffects& effects);

}  // namespace graybox
