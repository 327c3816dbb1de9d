// The families of information sets that the study runs beside the robot, by name. The robot alone
// is too easy a judge of first-order methods.
//
//   const graybox::InformationSet set = graybox::make_family("wis", 7920, 12, 1);
//
//   rob     log-normal Wishart matrices: a few outliers dominate; easy for first-order methods
//   wis     plain Wishart matrices
//   flat    Wishart matrices of 200 degrees of freedom: all candidates nearly equal
//   smo     smooth manifold over four angles, parameters scaled over five decades
//   smr6    the same with matrices of rank 6, unscaled
//   r1g     rank one, Gaussian
//   r1l     rank one, log-normal scales
//   cube3   the 3^7 grid of a quadratic-type regression: massive ties, many optimal designs
//   cube5   the same on 5^7 points
//   dup     every matrix of rob ten times
//   decades Wishart matrices whose diagonals spread over twelve decades
//
// Mathematics in random_families.hpp, smooth_family.hpp and regression.hpp. But for cube3, cube5
// and dup, the family of Q candidates is the beginning of every larger one of the same d and seed.
// The numbers depend on the name, Q, d and the seed, not on threads or vector width; another C
// library's log, sin and cos may change last bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "graybox/problems/information_set.hpp"

namespace graybox {

struct Family {
  std::string name;
  std::string description;  // one line
  std::size_t default_candidates = 0;
  std::size_t default_dimension = 0;
  bool fixed_size = false;  // only the defaults: cube3, cube5
};

[[nodiscard]] const std::vector<Family>& families();

// Zero for candidates or dimension asks for the default. Throws InputError for an unknown name
// (listing all), and for sizes the family can't have.
[[nodiscard]] InformationSet make_family(std::string_view name, std::size_t candidates = 0,
                                         std::size_t dimension = 0, std::uint64_t seed = 1);

}  // namespace graybox
