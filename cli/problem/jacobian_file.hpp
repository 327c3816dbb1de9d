// The files of `graybox problem from-jacobians`: Jacobians, noise, nominal parameters, coordinates.
// All throw InputError with file, place and remedy.
#pragma once

#include <string>
#include <vector>

#include "problems/information/block_effects.hpp"
#include "problems/information/jacobian_information.hpp"

namespace graybox::cli {

// Jacobians, one row for each candidate and output, the outputs of a candidate together:
//
//   .npy   [Q x r x d], or [Q r x d]
//   text   d columns, the header their names (number_table.hpp). A column `candidate` tells which
//          rows belong together; it is no parameter.
//
// `outputs` is r; 0: what the file says, or else 1.
[[nodiscard]] Jacobians read_jacobians(const std::string& path, std::size_t outputs);

// "0.1" for all outputs, "0.1,0.2" for each, or the file of a covariance matrix.
[[nodiscard]] JacobianNoise read_noise(const std::string& text, std::size_t outputs);

// The effects of a block, rows as in the Jacobians; the header their names.
[[nodiscard]] BlockEffects read_block_effects(const std::string& path, const Jacobians& jacobians,
                                              std::size_t blocks);

// "k=0.5,c=2", "0.5,2", or a file of one row or one column; in the order of the Jacobians' columns.
[[nodiscard]] std::vector<double> read_nominal(const std::string& text, const Jacobians& jacobians);

// One row a candidate; a header names the coordinates, with units as "angle [deg]".
[[nodiscard]] CandidateTable read_coordinates(const std::string& path, std::size_t candidates);

}  // namespace graybox::cli
