#include "diagnosis/responses/distortion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "problems/base/distributions.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;

constexpr double kRounding = 1e-12;  // of the output: no noise, nothing to compare with

MatrixXcd interpolated(const FrequencyResponseEstimate& estimate, std::size_t line) {
  const auto above = static_cast<std::size_t>(std::ranges::upper_bound(estimate.lines, line) -
                                              estimate.lines.begin());
  const std::size_t low = estimate.lines[above - 1], high = estimate.lines[above];
  const double share = static_cast<double>(line - low) / static_cast<double>(high - low);
  return (1.0 - share) * estimate.responses[above - 1] + share * estimate.responses[above];
}

}  // namespace

std::vector<DetectionLine> detect_distortion(const std::vector<const LineSpectra*>& spectra,
                                             const std::vector<std::size_t>& lines,
                                             const FrequencyResponseEstimate& estimate) {
  const auto outputs = static_cast<Index>(estimate.outputs.size());
  const auto inputs = static_cast<Index>(estimate.inputs.size());
  const Eigen::VectorXd floor =
      (kRounding * estimate.output_level.rowwise().maxCoeff()).cwiseAbs2();
  std::vector<DetectionLine> result;
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const MatrixXcd response = interpolated(estimate, lines[k]);
    Eigen::VectorXd power = Eigen::VectorXd::Zero(outputs), noise = power;
    Index samples = 0;
    const auto corrected = [&](const auto& signals) -> MatrixXcd {
      return signals.topRows(outputs) - response * signals.middleRows(outputs, inputs);
    };
    for (const LineSpectra* one : spectra) {
      power += corrected(one->values.col(static_cast<Index>(k))).cwiseAbs2();
      noise += corrected(one->samples[k]).rowwise().squaredNorm();
      samples += one->samples[k].cols();
    }
    if (samples == 0) continue;
    const auto count = static_cast<double>(spectra.size());
    power /= count;
    noise /= static_cast<double>(samples);
    DetectionLine line{.line = lines[k],
                       .frequency = 2.0 * std::numbers::pi * static_cast<double>(lines[k]) /
                                    (static_cast<double>(estimate.period) * estimate.sample_time),
                       .level = power.cwiseSqrt(),
                       .noise = noise.cwiseSqrt(),
                       .p_value = Eigen::VectorXd::Ones(outputs)};
    for (Index i = 0; i < outputs; ++i) {
      if (!(noise(i) > floor(i))) continue;
      line.p_value(i) =
          fisher_tail(power(i) / noise(i), 2.0 * count, 2.0 * static_cast<double>(samples));
    }
    result.push_back(std::move(line));
  }
  return result;
}

Eigen::MatrixXd total_over_noise(const FrequencyResponseEstimate& estimate) {
  if (estimate.total.empty() || estimate.noise.empty()) return {};
  const auto outputs = static_cast<Index>(estimate.outputs.size());
  Eigen::MatrixXd p_values =
      Eigen::MatrixXd::Ones(outputs, static_cast<Index>(estimate.noise.size()));
  for (std::size_t k = 0; k < estimate.noise.size(); ++k) {
    const OutputCovariance& total = estimate.total[k];
    const OutputCovariance& noise = estimate.noise[k];
    for (Index i = 0; i < outputs; ++i) {
      const double ratio = total.covariance(i, i).real() / noise.covariance(i, i).real();
      if (!std::isfinite(ratio)) continue;
      p_values(i, static_cast<Index>(k)) =
          fisher_tail(ratio, 2.0 * total.degrees_of_freedom, 2.0 * noise.degrees_of_freedom);
    }
  }
  return p_values;
}

std::vector<bool> discoveries(const std::vector<double>& p_values, double rate) {
  std::vector<std::size_t> order(p_values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t k) { return p_values[k]; });
  double harmonic = 0.0;
  for (std::size_t r = 1; r <= order.size(); ++r) harmonic += 1.0 / static_cast<double>(r);
  const auto count = static_cast<double>(order.size());
  std::size_t rejected = 0;
  for (std::size_t r = 1; r <= order.size(); ++r) {
    if (p_values[order[r - 1]] <= rate * static_cast<double>(r) / (count * harmonic)) rejected = r;
  }
  std::vector<bool> result(p_values.size(), false);
  for (std::size_t r = 0; r < rejected; ++r) result[order[r]] = true;
  return result;
}

}  // namespace graybox
