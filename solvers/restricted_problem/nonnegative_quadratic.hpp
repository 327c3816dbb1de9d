// Small strictly convex quadratic programs over the non-negative orthant,
//
//   minimise  mu^T A mu / 2 - r^T mu   subject to  mu >= 0,
//
// by block principal pivoting (Portugal, Judice and Vicente 1994; Kim and Park 2011). Guess the
// free set, solve its linear system, exchange every index whose sign is wrong. After three
// exchanges without progress, exchange only the last wrong one (Murty's rule), which is finite for
// positive definite A. Warm starts with the right free set cost one Cholesky factorisation of the
// free block. Cost O(pivots * f^3 / 3) for f free variables. No allocation after reserve().
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "problems/base/aligned_array.hpp"

namespace graybox {

class NonnegativeQuadratic {
 public:
  void reserve(std::size_t variables);

  // matrix: lower triangle, column-major n x n. On entry mu > 0 marks the guessed free set; on
  // return mu is the solution. False where factorisation or pivoting failed, or it was asked to
  // stop (stop.hpp); mu is then unchanged.
  [[nodiscard]] bool solve(std::span<const double> matrix, std::span<const double> linear,
                           std::span<double> mu);

 private:
  bool solve_free_block(std::span<const double> matrix, std::span<const double> linear);
  std::size_t find_wrong_signs(std::span<const double> matrix, std::span<const double> linear,
                               double tolerance);

  std::vector<std::size_t> free_;   // indices of the free variables, ascending
  std::vector<char> is_free_;       // per variable
  AlignedArray block_;              // free block of the matrix, then its factor
  std::vector<double> value_;       // solution on the free block
  std::vector<double> spread_;      // the same among all variables
  std::vector<double> gradient_;    // r - A mu
  std::vector<std::size_t> wrong_;  // indices to exchange
};

}  // namespace graybox
