// Complex columns as real ones of twice the length, real and imaginary parts in turn, as
// std::complex stores them. Then Re A^H B = as_real(A)^T as_real(B). This is a quarter of the work
// of the complex product and without a copy.
#pragma once

#include <Eigen/Core>

namespace graybox {

[[nodiscard]] inline Eigen::Map<const Eigen::MatrixXd> as_real(const Eigen::MatrixXcd& values) {
  return {reinterpret_cast<const double*>(values.data()), 2 * values.rows(), values.cols()};
}
[[nodiscard]] inline Eigen::Map<const Eigen::VectorXd> as_real(const Eigen::VectorXcd& values) {
  return {reinterpret_cast<const double*>(values.data()), 2 * values.size()};
}

}  // namespace graybox
