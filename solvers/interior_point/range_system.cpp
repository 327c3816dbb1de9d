#include "solvers/interior_point/range_system.hpp"

#include <cmath>
#include <numbers>

#include "problems/base/aligned_array.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "solvers/core/lapack.hpp"
#include "solvers/core/tiled_cholesky.hpp"
#include "solvers/interior_point/hessian_assembly.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXd;

class DenseRangeSystem final : public RangeSystem {
 public:
  DenseRangeSystem(const NormalizedSet& normal, int threads)
      : normal_(normal),
        threads_(threads),
        scale_(symmetric_scale(normal.dimension())),
        assembly_(normal.packed_size(), threads),
        gram_(normal.packed_size() * normal.packed_size()),
        factor_(gram_.size()),
        diagonal_(normal.packed_size()) {}

  bool factorise(const MatrixXd& inverse_scaling, std::span<const double> ratios) override {
    const std::size_t p = normal_.packed_size();
    if (!assembly_.assemble(normal_.rows(), normal_.candidate_count(), ratios, gram_.span())) {
      return false;
    }
    inverse_.noalias() = inverse_scaling.transpose() * inverse_scaling;  // R
    add_barrier();
    for (std::size_t k = 0; k < p; ++k) diagonal_[k] = 1.0 / std::sqrt(gram_[k * p + k]);
    double shift = 0.0;
    for (int attempt = 0; attempt < 5; ++attempt) {
      copy_scaled(shift);
      if (factorise_cholesky_tiled(p, factor_.data(), threads_)) return true;
      if (stop_requested()) return false;
      shift = shift == 0.0 ? 1e-15 * static_cast<double>(p) : 100.0 * shift;
    }
    return false;
  }

  void solve(std::span<double> x, std::size_t columns) override {
    const std::size_t p = normal_.packed_size();
    for (std::size_t k = 0; k < x.size(); ++k) x[k] *= diagonal_[k % p];
    lapack::solve_cholesky(p, factor_.data(), columns, x.data());
    for (std::size_t k = 0; k < x.size(); ++k) x[k] *= diagonal_[k % p];
  }

 private:
  // gram, from packed to symmetric vectorisation, plus R (x) R, whose entry for the pairs (i, j)
  // and (k, l) is (R_ik R_jl + R_il R_jk) times 1/sqrt(2) for each pair with equal indices.
  void add_barrier() {
    const auto d = static_cast<Eigen::Index>(normal_.dimension());
    const std::size_t p = normal_.packed_size();
    std::size_t row = 0;
    for (Eigen::Index i = 0; i < d; ++i) {
      for (Eigen::Index j = 0; j <= i; ++j, ++row) {
        std::size_t column = 0;
        for (Eigen::Index k = 0; k <= i && column <= row; ++k) {
          for (Eigen::Index l = 0; l <= k && column <= row; ++l, ++column) {
            const double both = inverse_(i, k) * inverse_(j, l) + inverse_(i, l) * inverse_(j, k);
            const double weight = scale_[row] * scale_[column];
            gram_[row * p + column] = weight * (gram_[row * p + column] + 0.5 * both);
          }
        }
      }
    }
  }

  // To unit diagonal, into the triangle that LAPACK reads.
  void copy_scaled(double shift) {
    const std::size_t p = normal_.packed_size();
    for (std::size_t a = 0; a < p; ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        factor_[b * p + a] = diagonal_[a] * diagonal_[b] * gram_[a * p + b];
      }
      factor_[a * p + a] = 1.0 + shift;
    }
  }

  const NormalizedSet& normal_;
  int threads_;
  std::vector<double> scale_;
  HessianAssembly assembly_;
  AlignedArray gram_;
  AlignedArray factor_;
  std::vector<double> diagonal_;
  MatrixXd inverse_;
};

}  // namespace

std::unique_ptr<RangeSystem> make_dense_range_system(const NormalizedSet& normal, int threads) {
  return std::make_unique<DenseRangeSystem>(normal, threads);
}

std::vector<double> symmetric_scale(std::size_t dimension) {
  std::vector<double> scale(packed_size(dimension), std::numbers::sqrt2);
  for (std::size_t i = 0; i < dimension; ++i) scale[packed_index(i, i)] = 1.0;
  return scale;
}

}  // namespace graybox
