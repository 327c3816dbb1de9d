// The scaling of Nesterov and Todd (1997) for a pair of positive definite d x d matrices W and M
// that an interior-point method drives to W M = I. With P the geometric mean of M^-1 and W (P M P =
// W) and P = G G^T, both become the same diagonal matrix,
//
//   G^-1 W G^-T = G^T M G = diag(v),
//
// and W M = I linearises symmetrically, in the scaled steps dW~ = G^-1 dW G^-T, dM~ = G^T dM G, to
//
//   dW~ + dM~ = E,    E = diag(1/v - v).
//
// Mehrotra's second-order term of the product W M is E_kl -= (dW~ dM~ + dM~ dW~)_kl / (v_k + v_l).
//
// Factors, for M = L L^T: L^T W L = U diag(theta) U^T; v = theta^(1/2), G = L^-T U theta^(1/4),
// G^-1 = theta^(-1/4) U^T L^T. About 15 d^3 flops; no allocation after construction.
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <span>

namespace graybox {

class NesterovTodd {
 public:
  explicit NesterovTodd(std::size_t dimension);

  // `factor` and `inverse_factor`: L and L^-1, packed lower triangles. False where W is not
  // numerically positive definite; residual() is then undefined, otherwise it is diag(1/v - v).
  [[nodiscard]] bool compute(const Eigen::MatrixXd& w, std::span<const double> factor,
                             std::span<const double> inverse_factor);

  [[nodiscard]] const Eigen::MatrixXd& scaling() const { return scaling_; }          // G
  [[nodiscard]] const Eigen::MatrixXd& inverse_scaling() const { return inverse_; }  // G^-1
  [[nodiscard]] const Eigen::MatrixXd& residual() const { return residual_; }        // E

  // Subtracts the second-order term of the scaled steps dW~ and dM~ = E - dW~ from E.
  void add_second_order(const Eigen::MatrixXd& scaled_w_step);

  // The largest t <= infinity with W + t dW >= 0.
  [[nodiscard]] double step_to_boundary(const Eigen::MatrixXd& scaled_w_step);

 private:
  Eigen::Index d_;
  Eigen::MatrixXd factor_, scaling_, inverse_, residual_, product_;
  Eigen::VectorXd v_, root_;  // v and v^(1/2)
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen_;
};

}  // namespace graybox
