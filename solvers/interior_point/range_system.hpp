// RangeSystem: the p x p matrix that both interior-point forms reduce their Newton step to,
//
//   S = N + sum_i D_i a_i a_i^T,     N = R (x) R,  R = G^-T G^-1 (nesterov_todd.hpp),
//
// a_i the entries of row i of a NormalizedSet. Everything is in symmetric vectorisation: packed
// entries off the diagonal times sqrt(2), so that dot products are traces.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "solvers/conditioning/normalized_set.hpp"

namespace graybox {

class RangeSystem {
 public:
  virtual ~RangeSystem() = default;

  // Forms and factorises S from G^-1 (d x d) and D >= 0; one pass over the rows. A matrix that is
  // not numerically positive definite is regularised; false where that does not help either.
  [[nodiscard]] virtual bool factorise(const Eigen::MatrixXd& inverse_scaling,
                                       std::span<const double> ratios) = 0;

  // x := S^-1 x for `columns` right sides of p numbers, one after the other.
  virtual void solve(std::span<double> x, std::size_t columns) = 0;
};

using MakeRangeSystem =
    std::function<std::unique_ptr<RangeSystem>(const NormalizedSet& normal, int threads)>;

// The assembly through HessianAssembly, Q p^2 flops, and a dense Cholesky factor, p^3/3.
[[nodiscard]] std::unique_ptr<RangeSystem> make_dense_range_system(const NormalizedSet& normal,
                                                                   int threads);

// 1 for the diagonal, sqrt(2) for the other packed entries.
[[nodiscard]] std::vector<double> symmetric_scale(std::size_t dimension);

}  // namespace graybox
