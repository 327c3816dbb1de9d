#include "diagnosis/responses/confidence.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

// T ~ scale F(numerator, denominator).
struct TraceDistribution {
  double scale, numerator, denominator;
};

TraceDistribution trace_distribution(std::size_t outputs, std::size_t inputs, double q) {
  const auto p = static_cast<double>(outputs);
  const auto m = static_cast<double>(inputs);
  const double c = q - p;
  if (!(c > 1.0)) {
    throw InputError(fmt::format(
        "a region for {} outputs needs more than {} degrees of freedom, not {:g}: pool more lines",
        outputs, outputs + 1, q));
  }
  const double mean = q * p * m / c;
  const double square = q * q * (m * m * (c * p * p + p) + m * p * (c + p)) / (c * (c * c - 1.0));
  // E F = D / (D - 2) and E F^2 / (E F)^2 = (n + 2) (D - 2) / (n (D - 4)) with n = 2 p m.
  const double n = 2.0 * p * m;
  const double ratio = square / (mean * mean) * n / (n + 2.0);
  const double denominator = (4.0 * ratio - 2.0) / (ratio - 1.0);
  return {mean * (denominator - 2.0) / denominator, n, denominator};
}

}  // namespace

Eigen::MatrixXd confidence_radius(const FrequencyResponseEstimate& estimate, std::size_t line,
                                  double probability) {
  const double q = estimate.best_covariance()[line].degrees_of_freedom;
  return (fisher_quantile(probability, 2.0, 2.0 * q) * estimate.variance(line)).cwiseSqrt();
}

double response_statistic(const OutputCovariance& covariance, const Eigen::MatrixXcd& input_gram,
                          const Eigen::MatrixXcd& error) {
  const Eigen::LLT<Eigen::MatrixXcd> outputs(covariance.covariance);
  const Eigen::LLT<Eigen::MatrixXcd> inputs(input_gram);
  const Eigen::MatrixXcd half = outputs.matrixL().solve(error);
  return inputs.matrixL().solve(half.adjoint()).squaredNorm();
}

double response_tail(double statistic, std::size_t outputs, std::size_t inputs,
                     double degrees_of_freedom) {
  const TraceDistribution law = trace_distribution(outputs, inputs, degrees_of_freedom);
  return fisher_tail(statistic / law.scale, law.numerator, law.denominator);
}

double response_threshold(double probability, std::size_t outputs, std::size_t inputs,
                          double degrees_of_freedom) {
  const TraceDistribution law = trace_distribution(outputs, inputs, degrees_of_freedom);
  return law.scale * fisher_quantile(probability, law.numerator, law.denominator);
}

}  // namespace graybox
