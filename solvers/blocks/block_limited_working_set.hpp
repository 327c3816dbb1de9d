// BlockLimitedWorkingSet: the block-limited D-optimal design (block_limited_certificate.hpp)
// restricted to some dozens or hundreds of candidates, by a primal-dual interior point: the inner
// problem of block_limited_column_generation.
//
//   minimise  -log det M(lambda)   subject to   1^T lambda = 1,   E lambda + s = c 1,
//   lambda, s >= 0,
//
// E the incidence matrix of the blocks that occur. With multipliers nu, kappa_b >= 0 (of the
// limits) and z_i >= 0 (of lambda_i >= 0) the optimality conditions are
//
//   z_i = nu + kappa_b(i) - w_i,    lambda_i z_i = mu -> 0,    s_b kappa_b = mu -> 0.
//
// Newton's step on them, with K_ij = tr(M^-1 H_i M^-1 H_j) the Hessian of -log det M, reduces to
//
//   (K + T) dlambda + 1 dnu = w - nu + mu/lambda - E^T mu/s,    1^T dlambda = 1 - 1^T lambda,
//   T = D + E^T Gamma E,    D = diag(z_i / lambda_i),   Gamma = diag(kappa_b / s_b).
//
// K + T is positive definite; it is factorised dense. (The form of Sherman, Morrison and
// Woodbury through the range of K would be linear in the number of members, but D^-1 grows without
// bound on the support and takes the digits with it.)
//
// The step in lambda is a descent direction of -log det M - mu (sum_i log lambda_i + sum_b log s_b)
// (primal feasibility is kept). A line search on it therefore makes the method safe far from the
// optimum. Near it steps go 99.5 % of the way to the boundary and mu falls as its power 1.5.
//
// Stopping. (max_i (w_i - kappa_b(i)) + c sum_b kappa_b) / d - 1 is an upper bound of the gap on
// the working set, by weak duality of the linear programme in the certificate.
//
// Cost of a step, n members: n d^3 (whitening) + n^2 p / 2 (K) + n^3 / 3. About 10 to 20 steps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "solvers/core/inverse_cholesky.hpp"

namespace graybox {

class BlockLimitedWorkingSet {
 public:
  // Blocks are numbered below block_count; each may have at most `limit` of the weight.
  BlockLimitedWorkingSet(std::size_t dimension, std::size_t block_count, double limit);

  // Copies the packed matrix. False for a candidate that is there already.
  bool add(std::size_t candidate, std::uint32_t block, const double* information);

  // Whether the blocks that occur can hold more than a weight of one, so that the limits leave an
  // interior.
  [[nodiscard]] bool feasible() const;

  // Solves to the gap asked for, starting near the last weights if `pool_gap`, the gap of the last
  // pricing, is small; then members outside the support get weight zero. False where the
  // information matrix is singular; where rounding or the step limit stops it short, gap() says how
  // short. Requires feasible().
  [[nodiscard]] bool optimise(double pool_gap, double tolerance, int step_limit = 60);

  // After optimise(): drops members without weight whose reduced cost z_i is above `reduced_cost`,
  // as far as enough blocks stay.
  void drop_idle(double reduced_cost);

  [[nodiscard]] std::size_t size() const { return indices_.size(); }
  [[nodiscard]] std::span<const std::size_t> indices() const { return indices_; }
  [[nodiscard]] std::span<const double> weights() const { return weights_; }
  [[nodiscard]] const InverseCholesky& inverse() const { return inverse_; }  // at weights()
  [[nodiscard]] double gap() const { return gap_; }
  // kappa_b for every block, zero for those without members; their sum; max_i (w_i - kappa_b(i)).
  [[nodiscard]] std::span<const double> prices() const { return prices_; }
  [[nodiscard]] double price_sum() const { return price_sum_; }
  [[nodiscard]] double level() const { return level_; }

 private:
  static constexpr std::uint32_t kNone = 0xffffffff;

  void reserve();
  [[nodiscard]] bool start(double pool_gap);
  [[nodiscard]] bool evaluate();
  void information(std::span<const double> weights, std::span<double> packed) const;
  void choose_centring(double tolerance);
  [[nodiscard]] bool factorise();
  [[nodiscard]] bool factorise(double share);
  [[nodiscard]] bool direction();
  [[nodiscard]] bool step();
  [[nodiscard]] double barrier(double step);
  [[nodiscard]] bool drop_below(double threshold);
  [[nodiscard]] bool drop_negligible(double tolerance);

  std::size_t dimension_, packed_size_, stride_;
  double limit_;

  // Members, in the order of their addition; blocks that occur likewise.
  std::vector<std::size_t> indices_;
  std::vector<std::uint32_t> block_;         // of each member, as its place in occurring_
  std::vector<double> rows_;                 // copies of the packed matrices
  std::vector<std::uint32_t> occurring_;     // blocks
  std::vector<std::uint32_t> block_place_;   // of every block in occurring_, or kNone
  std::vector<std::uint32_t> member_count_;  // of each block that occurs

  // Iterate and step: lambda, z by member, s and kappa by block.
  std::vector<double> weights_, reduced_cost_, slack_, price_;
  std::vector<double> weight_step_, reduced_cost_step_, slack_step_, price_step_;
  double multiplier_ = 0.0, multiplier_step_ = 0.0;  // nu
  double centring_ = 0.0;                            // mu
  bool started_ = false;

  std::vector<double> sensitivity_;  // w of the members
  AlignedArray whitened_;            // rows that multiply to K_ij
  std::vector<double> system_;       // K + T, its factor: n x n
  std::vector<double> right_, ones_solution_;
  std::vector<std::size_t> all_members_;
  std::vector<double> scratch_;
  std::vector<double> matrix_, matrix_step_, trial_matrix_;
  InverseCholesky inverse_, trial_;

  double gap_ = 0.0, level_ = 0.0, price_sum_ = 0.0;
  std::vector<double> prices_;
};

}  // namespace graybox
