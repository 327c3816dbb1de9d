#include "diagnosis/responses/frequency_response_estimate.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr double kLeastNoise = 1e-26;  // of the output's power: rounding

std::string place_of(const FrequencyResponseEstimate& estimate) {
  return fmt::format("position [{:g}], level {:g}", fmt::join(estimate.position, ", "),
                     estimate.level);
}

const std::vector<OutputCovariance>& covariance_of(const FrequencyResponseEstimate& estimate,
                                                   CovarianceKind kind) {
  if (kind == CovarianceKind::kTotal && estimate.total.empty()) {
    throw InputError(
        fmt::format("{}: the total covariance needs two or more realisations", place_of(estimate)));
  }
  if (kind == CovarianceKind::kNoise && estimate.noise.empty()) {
    throw InputError(
        fmt::format("{}: the noise covariance needs two or more periods", place_of(estimate)));
  }
  if (kind == CovarianceKind::kTotal) return estimate.total;
  if (kind == CovarianceKind::kNoise) return estimate.noise;
  return estimate.best_covariance();
}

// Phi^(-1/2), symmetric, with the weight of an estimated Phi.
Eigen::MatrixXcd whitening(const OutputCovariance& noise,
                           const Eigen::Ref<const Eigen::VectorXd>& output_level) {
  const auto outputs = static_cast<double>(noise.covariance.rows());
  Eigen::MatrixXcd covariance = noise.covariance;
  // In units of the output levels, so that units don't decide about rank.
  const Eigen::VectorXd scale = output_level.cwiseMax(1e-300);
  covariance = scale.cwiseInverse().asDiagonal() * covariance * scale.cwiseInverse().asDiagonal();
  covariance.diagonal().array() += kLeastNoise;
  const Eigen::LLT<Eigen::MatrixXcd> root(covariance);
  const double weight = std::sqrt((noise.degrees_of_freedom - outputs) / noise.degrees_of_freedom);
  Eigen::MatrixXcd left = Eigen::MatrixXcd::Identity(covariance.rows(), covariance.cols());
  root.matrixL().solveInPlace(left);
  return weight * left * scale.cwiseInverse().asDiagonal();
}

// right right^H = (W^H W)^-1.
Eigen::MatrixXcd input_factor(const Eigen::MatrixXcd& input_gram) {
  const Eigen::LLT<Eigen::MatrixXcd> root(input_gram);
  Eigen::MatrixXcd right = Eigen::MatrixXcd::Identity(input_gram.rows(), input_gram.cols());
  root.matrixU().solveInPlace(right);
  return right;
}

}  // namespace

std::string_view to_string(ResponseMethod method) {
  return method == ResponseMethod::kPeriodic ? "periodic" : "local_polynomial";
}

const std::vector<OutputCovariance>& FrequencyResponseEstimate::best_covariance() const {
  if (!total.empty()) return total;
  if (!noise.empty()) return noise;
  throw InputError(fmt::format(
      "{}: one period of one realisation tells nothing of the noise; record two or more periods",
      place_of(*this)));
}

Eigen::MatrixXd FrequencyResponseEstimate::variance(std::size_t line) const {
  return best_covariance()[line].covariance.diagonal().real() *
         input_gram[line].diagonal().real().transpose();
}

ResponseMeasurement response_measurement(const FrequencyResponseEstimate& estimate,
                                         CovarianceKind kind) {
  const auto& covariance = covariance_of(estimate, kind);
  ResponseMeasurement measurement;
  measurement.position =
      Eigen::Map<const Eigen::VectorXd>(estimate.position.data(),
                                        static_cast<Eigen::Index>(estimate.position.size())) *
      (std::numbers::pi / 180.0);
  measurement.frequencies = estimate.frequencies;
  measurement.responses = estimate.responses;
  for (std::size_t k = 0; k < covariance.size(); ++k) {
    const auto outputs = static_cast<double>(estimate.outputs.size());
    if (!(covariance[k].degrees_of_freedom > outputs + 1.0)) {
      throw InputError(fmt::format(
          "{}: {:g} degrees of freedom are too few for the covariance of {} outputs; record more "
          "periods, or pool more lines",
          place_of(estimate), covariance[k].degrees_of_freedom, outputs));
    }
    measurement.noise.push_back(
        {whitening(covariance[k], estimate.output_level.col(static_cast<Eigen::Index>(k))),
         input_factor(estimate.input_gram[k]), covariance[k].degrees_of_freedom});
  }
  return measurement;
}

}  // namespace graybox
