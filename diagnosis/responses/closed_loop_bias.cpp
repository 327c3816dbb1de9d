#include "graybox/diagnosis/responses/closed_loop_bias.hpp"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;

constexpr int kSteps = 400;  // of the integral, by Simpson's rule in x = t / (1 + t)

// E exp(-power / (1 + c t)), t ~ Gamma(shape), shape >= 1.
double mean_exponential(double power, double c, double shape) {
  const auto integrand = [&](double x) {
    if (x >= 1.0) return 0.0;
    const double t = x / (1.0 - x);
    const double density =
        shape == 1.0
            ? std::exp(-t)
            : (t > 0.0 ? std::exp((shape - 1.0) * std::log(t) - t - std::lgamma(shape)) : 0.0);
    return density * std::exp(-power / (1.0 + c * t)) / ((1.0 - x) * (1.0 - x));
  };
  double sum = integrand(0.0) + integrand(1.0);
  for (int k = 1; k < kSteps; ++k) sum += (k % 2 == 1 ? 4.0 : 2.0) * integrand(k / double{kSteps});
  return sum / (3.0 * kSteps);
}

}  // namespace

Eigen::VectorXd quotient_bias(const Eigen::VectorXd& singular_values) {
  const Index count = singular_values.size();
  const Eigen::ArrayXd power = singular_values.array().square();
  const Eigen::ArrayXd inverse = (power + 1.0).inverse();
  Eigen::VectorXd bias(count);
  for (Index i = 0; i < count; ++i) {
    if (count == 1) {
      bias(i) = std::exp(-power(i));
      continue;
    }
    const auto others = static_cast<double>(count - 1);
    bias(i) = mean_exponential(power(i), (inverse.sum() - inverse(i)) / others, others);
  }
  return bias;
}

Eigen::MatrixXcd closed_loop_bias(const MatrixXcd& response, const MatrixXcd& input_power,
                                  const MatrixXcd& samples) {
  const Index inputs = response.cols(), outputs = response.rows();
  MatrixXcd bias = MatrixXcd::Zero(outputs, inputs);
  const auto count = static_cast<double>(samples.cols());
  const MatrixXcd input_noise = samples.bottomRows(inputs);
  const Eigen::LLT<MatrixXcd> root(input_noise * input_noise.adjoint() / count);
  if (samples.cols() < inputs || root.info() != Eigen::Success) return bias;
  const MatrixXcd output_noise = samples.topRows(outputs) - response * input_noise;
  const MatrixXcd correlation = output_noise * input_noise.adjoint() / count;
  // C Phi^(1/2) with Phi = L L^H, and A A^H = L^-1 U_0 U_0^H L^-H.
  const MatrixXcd half = root.matrixL().solve(input_power);
  const MatrixXcd power = root.matrixL().solve(half.adjoint());
  const Eigen::JacobiSVD<MatrixXcd> directions(power, Eigen::ComputeFullU);
  const Eigen::VectorXd excited =
      (directions.singularValues().array() - static_cast<double>(inputs)).max(0.0).sqrt();
  const Eigen::VectorXd values = quotient_bias(excited);
  if (!(values.maxCoeff() > 0.0)) return bias;
  const MatrixXcd& x = directions.matrixU();
  const MatrixXcd inner = x * values.asDiagonal() * x.adjoint();
  const MatrixXcd left = root.matrixL().solve(correlation.adjoint()).adjoint();
  return root.matrixU().solve((left * inner).adjoint()).adjoint().eval();
}

}  // namespace graybox
