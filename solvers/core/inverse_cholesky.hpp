// InverseCholesky: M = L L^T for a packed information matrix, with X = L^-1 and W = M^-1 = X^T X.
// The test of definiteness compares each pivot with its own diagonal entry, so that the units of
// the parameters do not matter. O(d^3), no allocation after construction.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace graybox {

class InverseCholesky {
 public:
  explicit InverseCholesky(std::size_t dimension);

  // False if M is not numerically positive definite; the object is then good for nothing but
  // another factor().
  [[nodiscard]] bool factor(std::span<const double> packed);
  // Only log det M; leaves the inverse as it is. Minus infinity where M is not positive definite.
  [[nodiscard]] double log_det_of(std::span<const double> packed);

  // X, packed lower triangle, row by row.
  [[nodiscard]] std::span<const double> inverse_factor() const { return inverse_; }
  // W in trace-dual packing: its dot product with packed H is tr(M^-1 H).
  [[nodiscard]] std::span<const double> trace_dual() const { return dual_; }
  [[nodiscard]] double log_det() const { return log_det_; }

 private:
  bool cholesky(std::span<const double> packed, double& log_det);
  void invert();

  std::size_t dimension_;
  std::vector<double> factor_;  // L, with reciprocals on the diagonal
  std::vector<double> inverse_;
  std::vector<double> dual_;
  double log_det_ = 0.0;
};

}  // namespace graybox
