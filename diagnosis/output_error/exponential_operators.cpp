#include "diagnosis/output_error/exponential_operators.hpp"

#include <array>
#include <unsupported/Eigen/MatrixFunctions>

namespace graybox {
namespace {

// e^X, phi_1(X), phi_2(X), phi_3(X).
std::array<Eigen::MatrixXd, 4> phi_functions(const Eigen::MatrixXd& x) {
  const Eigen::Index n = x.rows();
  Eigen::MatrixXd block = Eigen::MatrixXd::Zero(4 * n, 4 * n);
  block.topLeftCorner(n, n) = x;
  for (Eigen::Index k = 0; k < 3; ++k) block.block(k * n, (k + 1) * n, n, n).setIdentity();
  const Eigen::MatrixXd exponential = block.exp();
  std::array<Eigen::MatrixXd, 4> result;
  for (std::size_t k = 0; k < 4; ++k) {
    result[k] = exponential.block(0, static_cast<Eigen::Index>(k) * n, n, n);
  }
  return result;
}

// Those of [A 0; scale dA A] h: the derivatives are the lower left blocks. The scale keeps both
// blocks of a size, for the exponential's accuracy.
std::array<Eigen::MatrixXd, 4> phi_derivatives(const Eigen::MatrixXd& a, const Eigen::MatrixXd& da,
                                               double step) {
  const Eigen::Index n = a.rows();
  const double size = da.norm();
  std::array<Eigen::MatrixXd, 4> result;
  if (size == 0.0) {
    result.fill(Eigen::MatrixXd::Zero(n, n));
    return result;
  }
  const double scale = (a.norm() > 0.0 ? a.norm() : 1.0) / size;
  Eigen::MatrixXd pair = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  pair.topLeftCorner(n, n) = pair.bottomRightCorner(n, n) = a * step;
  pair.bottomLeftCorner(n, n) = da * (step * scale);
  const auto both = phi_functions(pair);
  for (std::size_t k = 0; k < 4; ++k) result[k] = both[k].bottomLeftCorner(n, n) / scale;
  return result;
}

using Functions = std::array<Eigen::MatrixXd, 4>;

Eigen::MatrixXd first_weight(const Functions& phi, double h) {
  return h * (phi[1] - 3.0 * phi[2] + 4.0 * phi[3]);
}
Eigen::MatrixXd middle_weight(const Functions& phi, double h) {
  return h * (2.0 * phi[2] - 4.0 * phi[3]);
}
Eigen::MatrixXd last_weight(const Functions& phi, double h) { return h * (4.0 * phi[3] - phi[2]); }

}  // namespace

ExponentialOperators exponential_operators(const Eigen::MatrixXd& a,
                                           const std::vector<Eigen::MatrixXd>& derivatives,
                                           double step) {
  const Functions half = phi_functions(a * (0.5 * step)), full = phi_functions(a * step);
  ExponentialOperators result;
  result.half_flow.matrix = half[0];
  result.half_input.matrix = 0.5 * step * half[1];
  result.flow.matrix = full[0];
  result.first.matrix = first_weight(full, step);
  result.middle.matrix = middle_weight(full, step);
  result.last.matrix = last_weight(full, step);
  for (const Eigen::MatrixXd& da : derivatives) {
    const Functions half_slope = phi_derivatives(a, da, 0.5 * step);
    const Functions slope = phi_derivatives(a, da, step);
    result.half_flow.derivatives.push_back(half_slope[0]);
    result.half_input.derivatives.push_back(0.5 * step * half_slope[1]);
    result.flow.derivatives.push_back(slope[0]);
    result.first.derivatives.push_back(first_weight(slope, step));
    result.middle.derivatives.push_back(middle_weight(slope, step));
    result.last.derivatives.push_back(last_weight(slope, step));
  }
  return result;
}

}  // namespace graybox
