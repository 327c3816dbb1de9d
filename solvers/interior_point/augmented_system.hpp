// AugmentedSystem: the Newton system of both interior-point forms before elimination,
//
//   [ N    A^T  ] [ x ]   [ r ]        x: p numbers (symmetric vectorisation), y: Q numbers,
//   [ A   -D^-1 ] [ y ] = [ t ],       rows a_i of A as in range_system.hpp, D = diag(D_i) > 0.
//
// Eliminating all of y gives S x = r + A^T D t, S = N + A^T D A, y = D (A x - t). That is linear in
// Q but, near an optimum, where D_i grows without bound on the support and N does not, S has
// eigenvalues of both sizes and its factor loses the small ones: digits of y go with them. So the
// few rows with D_i |a_i|^2 far above |N|, B, are kept back (at most 2 p of them), and eliminated
// last by their Schur complement, which is diagonal plus Gram matrix and keeps its digits:
//
//   S_B x + A_B^T y_B = r + (A^T D t without B),     S_B = S without B,
//   (D_B^-1 + A_B S_B^-1 A_B^T) y_B = A_B S_B^-1 (r + ...) - t_B.
//
// Cost: factorise() one Hessian assembly and O(p^3); solve() two passes and O(p^2). No allocation
// after construction but of the underlying RangeSystem's.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "solvers/conditioning/normalized_set.hpp"
#include "solvers/interior_point/range_system.hpp"

namespace graybox {

class AugmentedSystem {
 public:
  AugmentedSystem(const NormalizedSet& normal, std::unique_ptr<RangeSystem> range, int threads = 1);

  // From G^-1 (N = R (x) R, R = G^-T G^-1) and D. False where a factorisation breaks down or time
  // is up (stop.hpp). One pass.
  [[nodiscard]] bool factorise(const Eigen::MatrixXd& inverse_scaling,
                               std::span<const double> ratios);

  // Given r in x and t, returns x, y and image = A x (for rows kept back t_i + y_i/D_i, which is
  // the same but keeps its digits). Two passes.
  void solve(std::span<double> x, std::span<const double> t, std::span<double> y,
             std::span<double> image);

 private:
  void choose_kept_back(double barrier_norm);
  [[nodiscard]] bool factorise_kept_back();
  void solve_kept_back(std::span<double> x, std::span<const double> t);

  const NormalizedSet& normal_;
  int threads_;
  std::unique_ptr<RangeSystem> range_;
  std::vector<double> scale_;
  std::vector<double> row_squares_;     // |a_i|^2
  std::vector<double> ratios_;          // D
  std::vector<double> weights_;         // scratch of Q
  std::vector<std::size_t> kept_back_;  // B
  AlignedArray rows_;                   // A_B, |B| x p in symmetric vectorisation
  AlignedArray columns_;                // S_B^-1 A_B^T, the same layout
  std::vector<double> schur_;           // factor of D_B^-1 + A_B S_B^-1 A_B^T
  std::vector<double> kept_solution_;   // y_B
  std::vector<double> packed_;
  Eigen::MatrixXd barrier_;
};

}  // namespace graybox
