// ScaledFactor: M = L L^T for a packed information matrix, by way of S M S of unit diagonal so that
// the units of the parameters do not matter, with X = L^-1 and W = M^-1 = X^T X. O(d^3), no
// allocation after construction.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace graybox {

class ScaledFactor {
 public:
  explicit ScaledFactor(std::size_t dimension);

  // False if M is not numerically positive definite; the object is then good for nothing but
  // another factorise().
  [[nodiscard]] bool factorise(std::span<const double> packed);

  [[nodiscard]] double log_det() const { return log_det_; }
  // M^-1 in trace-dual packing: its dot product with packed H is tr(M^-1 H).
  [[nodiscard]] std::span<const double> trace_dual() const { return trace_dual_; }
  // X, lower triangle in full row-major storage, zeros above.
  [[nodiscard]] std::span<const double> inverse_factor() const { return inverse_factor_; }

 private:
  bool cholesky(std::span<const double> packed);
  void invert();

  std::size_t dimension_;
  double log_det_ = 0.0;
  std::vector<double> factor_;
  std::vector<double> scale_;
  std::vector<double> inverse_factor_;
  std::vector<double> trace_dual_;
};

}  // namespace graybox
