#include "diagnosis/responses/closed_loop_bias.hpp"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;

constexpr double kNoBias = 60.0;      // s^2 of all inputs: b < 1e-20
constexpr double kStrongest = 300.0;  // stronger inputs count as so strong
constexpr double kMostShare = 0.99;   // of b, where the estimate divides by 1 - b

// The exponential of a matrix whose entries are not negative, by scaling, Taylor series and
// squaring.
Eigen::MatrixXd exponential(const Eigen::MatrixXd& matrix) {
  constexpr int kSquarings = 14, kTerms = 14;
  const Eigen::MatrixXd small = std::ldexp(1.0, -kSquarings) * matrix;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols()), term = sum;
  for (int k = 1; k <= kTerms; ++k) {
    term = (term * small / k).eval();
    sum += term;
  }
  for (int k = 0; k < kSquarings; ++k) sum = (sum * sum).eval();
  return sum;
}

// E p_i p_m exp(-sum p_l x_l), p uniform on the simplex.
double simplex_mean(const Eigen::VectorXd& x, Index i, Index m) {
  const Index n = x.size();
  Eigen::VectorXd nodes(n + 2);
  nodes << x, x(i), x(m);
  const double largest = x.maxCoeff();
  Eigen::MatrixXd chain = (largest - nodes.array()).matrix().asDiagonal();
  chain.diagonal(1).setOnes();
  // (n + 1)! times the divided difference, over n (n + 1) or half of that where i = m.
  const double factor = std::tgamma(static_cast<double>(n + 2)) * (i == m ? 2.0 : 1.0) /
                        static_cast<double>(n * (n + 1));
  return factor * std::exp(-largest) * exponential(chain)(0, n + 1);
}

// sum_k (n-k)! e_k of all but x_m, over n!.
double minors(const Eigen::VectorXd& x, Index m) {
  const Index n = x.size();
  Eigen::VectorXd e = Eigen::VectorXd::Zero(n);
  e(0) = 1.0;
  for (Index l = 0; l < n; ++l) {
    if (l == m) continue;
    for (Index k = n - 1; k > 0; --k) e(k) += x(l) * e(k - 1);
  }
  double sum = 0.0, weight = 1.0;
  for (Index k = 0; k < n; ++k) {
    sum += weight * e(k);
    weight /= static_cast<double>(n - k);
  }
  return sum;
}

}  // namespace

Eigen::VectorXd quotient_bias(const Eigen::VectorXd& power) {
  const Index n = power.size();
  Eigen::VectorXd bias = Eigen::VectorXd::Zero(n);
  if (power.minCoeff() > kNoBias) return bias;
  const Eigen::VectorXd x = power.cwiseMin(kStrongest);
  for (Index m = 0; m < n; ++m) {
    const double weight = static_cast<double>(n) * minors(x, m);
    for (Index i = 0; i < n; ++i) bias(i) += weight * simplex_mean(x, i, m);
  }
  return bias;
}

ClosedLoopBias closed_loop_bias(const MatrixXcd& response, const MatrixXcd& input_power,
                                const MatrixXcd& samples) {
  const Index inputs = response.cols(), outputs = response.rows();
  ClosedLoopBias result{MatrixXcd::Zero(outputs, inputs)};
  const auto count = static_cast<double>(samples.cols());
  const MatrixXcd input_noise = samples.bottomRows(inputs);
  const Eigen::LLT<MatrixXcd> root(input_noise * input_noise.adjoint() / count);
  if (samples.cols() < inputs || root.info() != Eigen::Success) return result;
  const MatrixXcd output_noise = samples.topRows(outputs) - response * input_noise;
  const MatrixXcd correlation = output_noise * input_noise.adjoint() / count;
  // With Phi_N = R R^H: A A^H = R^-1 U_0 U_0^H R^-H and C' R = Phi_vN R^-H.
  const MatrixXcd half = root.matrixL().solve(input_power);
  const MatrixXcd power = root.matrixL().solve(half.adjoint());
  const Eigen::JacobiSVD<MatrixXcd> directions(power, Eigen::ComputeFullU);
  const Eigen::VectorXd share =
      quotient_bias((directions.singularValues().array() - static_cast<double>(inputs)).max(0.0));
  result.share = share.maxCoeff();
  if (!(result.share > 0.0)) return result;
  const Eigen::ArrayXd kept = share.array().min(kMostShare);
  const MatrixXcd& x = directions.matrixU();
  const MatrixXcd inner = x * (kept / (1.0 - kept)).matrix().asDiagonal() * x.adjoint();
  const MatrixXcd left = root.matrixL().solve(correlation.adjoint()).adjoint();
  result.bias = root.matrixU().solve((left * inner).adjoint()).adjoint();
  return result;
}

}  // namespace graybox
