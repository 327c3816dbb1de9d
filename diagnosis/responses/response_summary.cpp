#include "diagnosis/responses/response_summary.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "problems/base/quantile.hpp"

namespace graybox {
namespace {

using Eigen::Index;

std::optional<double> median_of(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return {};
  std::ranges::sort(values);
  return quantile(values, 0.5);
}

std::vector<double> entries(const Eigen::ArrayXXd& values) {
  return {values.data(), values.data() + values.size()};
}

// Standard error of each row over its length.
std::vector<double> row_errors(const FrequencyResponseEstimate& estimate) {
  std::vector<double> errors;
  for (std::size_t k = 0; k < estimate.responses.size(); ++k) {
    const Eigen::ArrayXd error = estimate.variance(k).rowwise().sum().cwiseSqrt();
    const Eigen::ArrayXd length = estimate.responses[k].rowwise().norm();
    for (const double value : entries(error / length)) errors.push_back(value);
  }
  return errors;
}

std::optional<double> distortion(const FrequencyResponseEstimate& estimate, bool even) {
  Eigen::ArrayXd excess = Eigen::ArrayXd::Zero(estimate.output_level.rows());
  std::size_t count = 0;
  for (const DetectionLine& line : estimate.detection) {
    if (line.even() != even) continue;
    ++count;
    excess += line.level.array().square() - line.noise.array().square();
  }
  if (count == 0) return {};
  const double share = (excess / estimate.output_level.rowwise().squaredNorm().array()).maxCoeff();
  if (!(share > 0.0)) return {};
  return 10.0 * std::log10(share);
}

}  // namespace

Eigen::MatrixXd output_deviations(const std::vector<OutputCovariance>& covariance) {
  if (covariance.empty()) return {};
  Eigen::MatrixXd deviations(covariance.front().covariance.rows(),
                             static_cast<Index>(covariance.size()));
  for (std::size_t k = 0; k < covariance.size(); ++k) {
    deviations.col(static_cast<Index>(k)) =
        covariance[k].covariance.diagonal().real().cwiseMax(0.0).cwiseSqrt();
  }
  return deviations;
}

Eigen::MatrixXd distortion_levels(const FrequencyResponseEstimate& estimate, bool even) {
  const auto lines = static_cast<Index>(estimate.lines.size());
  Eigen::MatrixXd power = Eigen::MatrixXd::Zero(estimate.output_level.rows(), lines);
  Eigen::VectorXd count = Eigen::VectorXd::Zero(lines);
  for (const DetectionLine& line : estimate.detection) {
    if (line.even() != even) continue;
    const auto above = std::ranges::upper_bound(estimate.lines, line.line);
    auto nearest = static_cast<Index>(above - estimate.lines.begin());
    if (2 * line.line < *(above - 1) + *above) --nearest;
    power.col(nearest) +=
        (line.level.array().square() - line.noise.array().square()).max(0.0).matrix();
    count(nearest) += 1.0;
  }
  for (Index k = 0; k < lines; ++k) {
    if (count(k) > 0.0) {
      power.col(k) = (power.col(k) / count(k)).cwiseSqrt();
    } else {
      power.col(k).setConstant(std::numeric_limits<double>::quiet_NaN());
    }
  }
  return power;
}

ResponseSummary summarise(const FrequencyResponseEstimate& estimate) {
  ResponseSummary summary;
  const Eigen::ArrayXXd noise = output_deviations(estimate.noise);
  const Eigen::ArrayXXd total = output_deviations(estimate.total);
  if (noise.size() > 0 || total.size() > 0) {
    const Eigen::ArrayXXd ratio =
        20.0 * (estimate.output_level.array() / (noise.size() > 0 ? noise : total)).log10();
    summary.median_signal_to_noise = median_of(entries(ratio));
    summary.least_signal_to_noise = ratio.minCoeff();
    summary.median_error = median_of(row_errors(estimate));
    const auto least = std::ranges::min_element(estimate.best_covariance(), {},
                                                &OutputCovariance::degrees_of_freedom);
    summary.degrees_of_freedom = least->degrees_of_freedom;
  }
  if (noise.size() > 0 && total.size() > 0) {
    summary.total_over_noise = median_of(entries(20.0 * (total / noise).log10()));
  }
  summary.odd_distortion = distortion(estimate, false);
  summary.even_distortion = distortion(estimate, true);
  for (std::size_t k = 0; k < estimate.bias.size(); ++k) {
    const double share =
        (estimate.bias[k].cwiseAbs().array() / estimate.variance(k).array().sqrt()).maxCoeff();
    summary.largest_bias = std::max(summary.largest_bias.value_or(0.0), share);
    summary.feedback_share =
        std::max(summary.feedback_share.value_or(0.0), estimate.feedback_share[k]);
  }
  return summary;
}

}  // namespace graybox
