#include "solvers/restricted_problem/damped_least_squares.hpp"

#include <algorithm>
#include <numeric>

#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {

using Eigen::Index;
using Eigen::VectorXd;

bool DampedLeastSquares::factor(const double* rows, std::size_t stride, std::size_t columns,
                                const VectorXd& damping, Method method) {
  rows_ = rows;
  stride_ = static_cast<Index>(stride);
  columns_ = static_cast<Index>(columns);
  damping_ = damping;
  orthogonal_ = method == Method::kOrthogonal || !factor_normal_equations();
  if (orthogonal_) factor_orthogonally();
  return !orthogonal_ || qr_.matrixQR().allFinite();
}

bool DampedLeastSquares::factor_normal_equations() {
  const auto n = static_cast<std::size_t>(damping_.size());
  cholesky_.resize(n * n);
  dense_kernels().gram(rows_, n, static_cast<std::size_t>(stride_), cholesky_.data());
  for (std::size_t i = 0; i < n; ++i) {
    const double f = damping_(static_cast<Index>(i));
    cholesky_[i * n + i] += f * f;
  }
  return dense_kernels().cholesky(cholesky_.data(), n, 0.0);
}

void DampedLeastSquares::factor_orthogonally() {
  const Index n = damping_.size();
  const RowArray a = transposed();
  const VectorXd row_size = a.topRows(columns_).cwiseAbs().rowwise().maxCoeff();
  const auto size = [&](Index k) { return k < columns_ ? row_size(k) : damping_(k - columns_); };
  order_.resize(static_cast<std::size_t>(columns_ + n));
  std::iota(order_.begin(), order_.end(), Index{0});
  std::ranges::sort(order_, [&](Index k, Index l) { return size(k) > size(l); });
  stacked_.setZero(columns_ + n, n);
  Index row = 0;
  for (const Index k : order_) {
    if (k < columns_) {
      stacked_.row(row) = a.row(k);
    } else {
      stacked_(row, k - columns_) = damping_(k - columns_);
    }
    ++row;
  }
  qr_.compute(stacked_);
}

void DampedLeastSquares::solve(const VectorXd& r, const VectorXd& w, VectorXd& x) {
  if (!orthogonal_) {
    x.noalias() = transposed().topRows(columns_).transpose() * r;
    x += damping_.cwiseProduct(w);
    dense_kernels().cholesky_solve(cholesky_.data(), static_cast<std::size_t>(x.size()), x.data());
    return;
  }
  right_.resize(stacked_.rows());
  Index row = 0;
  for (const Index k : order_) right_(row++) = k < columns_ ? r(k) : w(k - columns_);
  x = qr_.solve(right_);
}

}  // namespace graybox
