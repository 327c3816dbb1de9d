#include "solvers/interior_point/nesterov_todd.hpp"

#include <cmath>
#include <limits>

namespace graybox {
namespace {

void unpack_lower(std::span<const double> packed, Eigen::MatrixXd& full) {
  full.setZero();
  std::size_t k = 0;
  for (Eigen::Index i = 0; i < full.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j, ++k) full(i, j) = packed[k];
  }
}

}  // namespace

NesterovTodd::NesterovTodd(std::size_t dimension)
    : d_(static_cast<Eigen::Index>(dimension)),
      factor_(d_, d_),
      scaling_(d_, d_),
      inverse_(d_, d_),
      residual_(d_, d_),
      product_(d_, d_),
      v_(d_),
      root_(d_),
      eigen_(d_) {}

bool NesterovTodd::compute(const Eigen::MatrixXd& w, std::span<const double> factor,
                           std::span<const double> inverse_factor) {
  unpack_lower(factor, factor_);
  residual_.noalias() = w * factor_;
  product_.noalias() = factor_.transpose() * residual_;
  eigen_.compute(product_);
  if (eigen_.info() != Eigen::Success) return false;
  const auto& theta = eigen_.eigenvalues();
  if (!(theta(0) > 0.0) || !std::isfinite(theta(d_ - 1))) return false;
  v_ = theta.cwiseSqrt();
  root_ = v_.cwiseSqrt();

  product_.noalias() = factor_ * eigen_.eigenvectors();
  inverse_ = root_.cwiseInverse().asDiagonal() * product_.transpose();
  unpack_lower(inverse_factor, factor_);
  product_.noalias() = factor_.transpose() * eigen_.eigenvectors();
  scaling_ = product_ * root_.asDiagonal();
  residual_ = (v_.cwiseInverse() - v_).asDiagonal();
  return true;
}

void NesterovTodd::add_second_order(const Eigen::MatrixXd& scaled_w_step) {
  factor_ = residual_ - scaled_w_step;
  product_.noalias() = scaled_w_step * factor_;
  for (Eigen::Index k = 0; k < d_; ++k) {
    for (Eigen::Index l = 0; l < d_; ++l) {
      residual_(k, l) -= (product_(k, l) + product_(l, k)) / (v_(k) + v_(l));
    }
  }
}

// From the smallest eigenvalue of diag(v)^(-1/2) dW~ diag(v)^(-1/2).
double NesterovTodd::step_to_boundary(const Eigen::MatrixXd& scaled_w_step) {
  const auto inverse_root = root_.cwiseInverse().asDiagonal();
  product_ = inverse_root * scaled_w_step * inverse_root;
  eigen_.compute(product_, Eigen::EigenvaluesOnly);
  const double smallest = eigen_.eigenvalues()(0);
  return smallest < 0.0 ? -1.0 / smallest : std::numeric_limits<double>::infinity();
}

}  // namespace graybox
