// CriterionFrame: the coordinates in which a smooth criterion (A, L, Ds; D is the case K = I of Ds)
// is diagonal at an information matrix M. With K of criterion.hpp, C = K^T M^-1 K of s columns,
//
//   f(M) = log tr C  (A, L)    or    f(M) = (log det C)/s  (Ds).
//
// Take X with X M X^T = I (inverse_cholesky.hpp), P = X K, and an orthogonal U with
//
//   A, L   P P^T = U diag(sigma) U^T,  D = sigma / sum sigma;
//   Ds     P = U_1 R (QR),             D = 1/s on the range of P, zero beside it.
//
// Then, with the axes X^ = U^T X, the gradient of -f is G = X^^T diag(D) X^, tr(G M) = sum D = 1:
// the matrix of certificate.hpp. O(d^3).
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <cstddef>
#include <span>
#include <vector>

#include "solvers/core/criterion.hpp"
#include "solvers/core/inverse_cholesky.hpp"

namespace graybox {

class CriterionFrame {
 public:
  // In the coordinates H_i -> R H_i R^T, R d x d row-major (the identity if empty), K becomes R K.
  // Not for E.
  CriterionFrame(const Criterion& criterion, std::size_t dimension,
                 std::span<const double> coordinates);

  // f at the M that `inverse` has factorised; the frame stays where it is.
  [[nodiscard]] double value(const InverseCholesky& inverse);
  // Moves the frame to that M and returns f.
  double compute(const InverseCholesky& inverse);

  [[nodiscard]] const Eigen::MatrixXd& axes() const { return axes_; }         // X^
  [[nodiscard]] const Eigen::VectorXd& shares() const { return shares_; }     // D
  [[nodiscard]] std::span<const double> trace_dual() const { return dual_; }  // G
  [[nodiscard]] bool is_trace() const { return is_trace_; }                   // A, L
  // Whether K has d columns, so that every optimum is regular.
  [[nodiscard]] bool complete() const { return k_.cols() == k_.rows(); }

 private:
  bool is_trace_;
  Eigen::MatrixXd k_, x_, whitened_, axes_, dual_matrix_;
  Eigen::VectorXd shares_;
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen_;
  Eigen::HouseholderQR<Eigen::MatrixXd> qr_;
  std::vector<double> dual_;
};

}  // namespace graybox
