#include "solvers/restricted_problem/criterion_frame.hpp"

#include <cmath>

#include "problems/base/packed_matrix.hpp"

namespace graybox {

using Eigen::Index;

CriterionFrame::CriterionFrame(const Criterion& criterion, std::size_t dimension,
                               std::span<const double> coordinates)
    : is_trace_(criterion.kind() == CriterionKind::kA || criterion.kind() == CriterionKind::kL),
      dual_(packed_size(dimension)) {
  const auto d = static_cast<Index>(dimension);
  const std::vector<double> factor = criterion.factor(dimension);
  k_ = Eigen::Map<const Eigen::MatrixXd>(factor.data(), d, static_cast<Index>(factor.size()) / d);
  if (!coordinates.empty()) {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    k_ = (Eigen::Map<const RowMajor>(coordinates.data(), d, d) * k_).eval();
  }
  x_ = Eigen::MatrixXd::Zero(d, d);
  shares_ = Eigen::VectorXd::Zero(d);
}

double CriterionFrame::value(const InverseCholesky& inverse) {
  const std::span<const double> packed = inverse.inverse_factor();
  for (Index i = 0, k = 0; i < x_.rows(); ++i) {
    for (Index j = 0; j <= i; ++j, ++k) x_(i, j) = packed[static_cast<std::size_t>(k)];
  }
  whitened_.noalias() = x_ * k_;
  if (is_trace_) return std::log(whitened_.squaredNorm());
  qr_.compute(whitened_);
  const Index s = k_.cols();
  return 2.0 * qr_.matrixQR().diagonal().head(s).cwiseAbs().array().log().sum() /
         static_cast<double>(s);
}

double CriterionFrame::compute(const InverseCholesky& inverse) {
  const double f = value(inverse);
  if (is_trace_) {
    dual_matrix_.noalias() = whitened_ * whitened_.transpose();
    eigen_.compute(dual_matrix_);
    shares_ = eigen_.eigenvalues().cwiseMax(0.0);
    shares_ /= shares_.sum();
    axes_.noalias() = eigen_.eigenvectors().transpose() * x_;
  } else {
    axes_ = qr_.householderQ().transpose() * x_;
    shares_.head(k_.cols()).setConstant(1.0 / static_cast<double>(k_.cols()));
  }
  dual_matrix_.noalias() = axes_.transpose() * shares_.asDiagonal() * axes_;
  pack_trace_dual(dual_matrix_.data(), static_cast<std::size_t>(x_.rows()), dual_.data());
  return f;
}

}  // namespace graybox
