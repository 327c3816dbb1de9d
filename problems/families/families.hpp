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
// and regressions on smooth curves over even points of [-1, 1], on which neighbours are nearly
// equal and the optimal support are a few points:
//
//   legendre, chebyshev, monomials   polynomials of degree d - 1: one optimal design, three bases
//   splines                          cubic B-splines
//   exponentials                     decays exp(-2^k t)
//
// Mathematics in random_families.hpp, smooth_family.hpp and regression.hpp. But for cube3, cube5,
// dup and the curves, the family of Q candidates is the beginning of every larger one of the same d
// and seed.
// The numbers depend on the name, Q, d and the seed, not on threads or vector width; another C
// library's log, sin and cos may change last bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

struct Family {
  std::string name;
  std::string description;  // one line
  std::size_t default_candidates = 0;
  std::size_t default_dimension = 0;
  bool fixed_size = false;  // only the defaults: cube3, cube5
  bool random = true;       // false: the seed does not matter, and neighbours in the order are
                            // neighbours on a curve, so that sizes are not nested
};

[[nodiscard]] const std::vector<Family>& families();

// Zero for candidates or dimension asks for the default. Throws InputError for an unknown name
// (listing all), and for sizes the family can't have (monomials and exponentials of many parameters
// are singular in double precision; the message names the basis to take). Factors are those of r1g
// and r1l; for other families it throws, too.
[[nodiscard]] InformationSet make_family(std::string_view name, std::size_t candidates = 0,
                                         std::size_t dimension = 0, std::uint64_t seed = 1,
                                         SetForm form = SetForm::kMatrices);

}  // namespace graybox
