// Small strictly convex quadratic programs over a box with a fixed sum,
//
//   minimise  y^T K y / 2 - r^T y   subject to  lower <= y <= upper,  sum_i y_i = 0,
//
// where y = 0 is feasible (lower <= 0 <= upper): the Newton step of a design under limits on its
// counts. Primal active-set method (Nocedal and Wright, Numerical Optimization, Algorithm 16.3)
// that starts with every variable free that could move: on the free set F the optimality conditions
//
//   K_FF y_F + nu 1 = r_F - K_FB y_B,    1^T y_F = -1^T y_B
//
// are solved by one Cholesky factorisation and two right sides. A step that leaves the box stops at
// the first limit, which joins B. At a full step, the variable of B whose multiplier has the wrong
// sign most is set free. The objective falls all the way, so a run cut short still gives a descent
// direction. Cost O(pivots f^3 / 3) for f free variables. No allocation after reserve().
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace graybox {

class BoxQuadratic {
 public:
  void reserve(std::size_t variables);

  // matrix: lower triangle, column-major n x n. y is overwritten by the solution. False where the
  // factorisation failed; y is then feasible and no worse than zero.
  [[nodiscard]] bool solve(std::span<const double> matrix, std::span<const double> linear,
                           std::span<const double> lower, std::span<const double> upper,
                           std::span<double> y);

 private:
  enum class Place : char { kFree, kLower, kUpper, kFixed };  // kFixed: lower = upper

  bool solve_free(std::span<const double> matrix, std::span<const double> linear,
                  std::span<const double> y);
  // Sets free the bound variable that gains most by it; with no free variable there is no
  // multiplier to compare with, and the best pair of variables is set free. False if none gains.
  bool release(std::span<const double> matrix, std::span<const double> linear,
               std::span<const double> y);
  [[nodiscard]] double gradient(std::span<const double> matrix, std::span<const double> linear,
                                std::span<const double> y, std::size_t i) const;
  void set_free(std::size_t i);
  [[nodiscard]] static double entry(std::span<const double> matrix, std::size_t n, std::size_t i,
                                    std::size_t j) {
    return i >= j ? matrix[j * n + i] : matrix[i * n + j];
  }

  std::vector<Place> place_;
  std::vector<std::size_t> free_;
  std::vector<double> block_;   // K_FF, then its factor
  std::vector<double> target_;  // y_F of the present free set
  std::vector<double> ones_;    // K_FF^-1 1
  double multiplier_ = 0.0;     // nu
};

}  // namespace graybox
