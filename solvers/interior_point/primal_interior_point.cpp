#include "solvers/interior_point/primal_interior_point.hpp"

#include <algorithm>
#include <cmath>

#include "problems/base/packed_matrix.hpp"
#include "solvers/core/lapack.hpp"
#include "solvers/core/tiled_cholesky.hpp"
#include "solvers/interior_point/primal_newton.hpp"
#include "solvers/interior_point/range_system.hpp"
#include "solvers/kernels/gram_kernels.hpp"

namespace graybox {
namespace {

class DensePrimalSystem final : public PrimalSystem {
 public:
  DensePrimalSystem(const NormalizedSet& normal, int threads)
      : normal_(normal),
        threads_(threads),
        transform_(normal.packed_size()),
        scale_(symmetric_scale(normal.dimension())),
        root_(normal.candidate_count()),
        workspace_(congruence_workspace_size(normal.dimension())),
        rows_(normal.candidate_count() * normal.packed_size()),
        matrix_(normal.candidate_count() * normal.candidate_count()) {}

  bool factorise(const Eigen::MatrixXd& inverse_scaling, std::span<const double> ratios) override {
    const std::size_t count = normal_.candidate_count(), p = normal_.packed_size();
    if (!choose_transform(inverse_scaling)) return false;
    gram_kernels().congruence(normal_.rows(), count, normal_.dimension(), transform_.data(),
                              rows_.data(), workspace_.data());
    for (std::size_t i = 0; i < count; ++i) {
      root_[i] = std::sqrt(ratios[i]);
      for (std::size_t k = 0; k < p; ++k) rows_[i * p + k] *= scale_[k] * root_[i];
    }
    if (!gram_tiled(count, p, rows_.data(), matrix_.data(), threads_)) return false;
    for (std::size_t i = 0; i < count; ++i) matrix_[i * count + i] += 1.0;
    return factorise_cholesky_tiled(count, matrix_.data(), threads_);
  }

  void solve(std::span<double> x) override {
    for (std::size_t i = 0; i < x.size(); ++i) x[i] *= root_[i];
    lapack::solve_cholesky(x.size(), matrix_.data(), 1, x.data());
    for (std::size_t i = 0; i < x.size(); ++i) x[i] *= root_[i];
  }

  [[nodiscard]] double factorise_passes() const override { return 3.0; }
  [[nodiscard]] double solve_passes() const override { return 0.0; }

 private:
  // X with X^T X = P: the inverse of the Cholesky factor of P^-1 = G^-T G^-1.
  bool choose_transform(const Eigen::MatrixXd& inverse_scaling) {
    const std::size_t d = normal_.dimension();
    square_.noalias() = inverse_scaling.transpose() * inverse_scaling;
    if (!lapack::factorise_cholesky(d, square_.data())) return false;
    lapack::invert_lower(d, square_.data());
    square_.transposeInPlace();
    pack(square_.data(), d, transform_.data());
    return true;
  }

  const NormalizedSet& normal_;
  int threads_;
  Eigen::MatrixXd square_;
  std::vector<double> transform_;
  std::vector<double> scale_;
  std::vector<double> root_;  // D^(1/2)
  std::vector<double> workspace_;
  AlignedArray rows_;    // U
  AlignedArray matrix_;  // I + U U^T, then its factor
};

}  // namespace

Solution PrimalInteriorPoint::solve(const InformationSet& set, const SolveOptions& options,
                                    SolveObserver* observer) const {
  return solve_primal(set, options, observer, [](const NormalizedSet& normal, int threads) {
    return std::make_unique<DensePrimalSystem>(normal, threads);
  });
}

}  // namespace graybox
