// DampedLeastSquares: min over x of ||A^T x - r||^2 + ||diag(f) x - w||^2, the linear system of an
// interior point whose matrix is A A^T + diag(f)^2. A is n x m, row i being column i of the
// least-squares matrix J = [A^T; diag(f)]. The entries f > 0, so that J has full rank whatever A
// is.
//
//   normal equations   Cholesky of A A^T + diag(f)^2: n^2 m / 2 + n^3 / 6 multiply-adds. Errors
//                      grow with the square of the condition of J.
//   orthogonal         Householder QR of J, its rows sorted by size (Cox and Higham 1998):
//                      n^2 (m + 2n/3) multiply-adds. Errors grow with the condition of J.
#pragma once

#include <Eigen/Core>
#include <Eigen/QR>
#include <cstddef>
#include <vector>

namespace graybox {

class DampedLeastSquares {
 public:
  enum class Method { kNormalEquations, kOrthogonal };

  // `rows`: A row by row, each of `stride` numbers (a multiple of 8, 64-byte aligned), of which
  // those from m = `columns` on are zero. The array is used by solve() too. The normal
  // equations give way to the orthogonal method where they break down; false where that is not
  // finite either.
  [[nodiscard]] bool factor(const double* rows, std::size_t stride, std::size_t columns,
                            const Eigen::VectorXd& damping, Method method);

  // r of m numbers, w of n numbers; x is resized.
  void solve(const Eigen::VectorXd& r, const Eigen::VectorXd& w, Eigen::VectorXd& x);

 private:
  using RowArray = Eigen::Map<const Eigen::MatrixXd, Eigen::Aligned64>;

  [[nodiscard]] RowArray transposed() const { return {rows_, stride_, damping_.size()}; }
  bool factor_normal_equations();
  void factor_orthogonally();

  const double* rows_ = nullptr;
  Eigen::Index stride_ = 0, columns_ = 0;
  Eigen::VectorXd damping_;
  bool orthogonal_ = false;
  std::vector<double> cholesky_;
  Eigen::MatrixXd stacked_;
  Eigen::VectorXd right_;
  std::vector<Eigen::Index> order_;  // row k of stacked_ is row order_[k] of J
  Eigen::HouseholderQR<Eigen::MatrixXd> qr_;
};

}  // namespace graybox
