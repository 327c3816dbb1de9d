// What the residuals of one recording have in common because its free motion was taken out with an
// error.
//
// The free motion of a record (transients.hpp) is known with an error of covariance I^-1. What that
// error does to the whitened outputs, m (over outputs and lines), adds to their unit covariance:
//
//   Cov = 1 + m I^-1 m^T = 1 + Q diag(v) Q^T,
//   Q orthonormal, a column or two for each mode in the band.
//
// Near a sharp mode v is about one: neighbouring lines and all outputs err together. Tests and fits
// that take lines for independent see structure in that which is none, up to 30 in chi-square for
// one parameter. So residuals and derivatives are multiplied by Cov^(-1/2), symmetric, so that a
// residual stays at its line.
//
// Real and imaginary parts count as real numbers in turn (real_products.hpp). Cost: O(n_y K r) a
// column.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace graybox {

struct CommonError {
  Eigen::MatrixXd directions;  // Q, [2 n_y (K+1)] x r
  Eigen::VectorXd variances;   // v > 0, r

  // Columns of n_y (K+1) complex numbers, times Cov^(-1/2).
  void take_out(Eigen::Ref<Eigen::MatrixXcd> columns) const;
  // Q diag(v / (1 + v))^(1/2): Cov^-1 = 1 - W W^T.
  [[nodiscard]] Eigen::MatrixXcd inverse_directions() const;
};

// Of whitened motion by departures, [n_y (K+1)] x n, and the information about these. Directions in
// which it is less than a hundredth of the noise's variance are left out.
[[nodiscard]] CommonError common_error(const Eigen::MatrixXcd& motion,
                                       const Eigen::LLT<Eigen::MatrixXd>& information);

}  // namespace graybox
