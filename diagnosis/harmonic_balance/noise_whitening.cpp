#include "diagnosis/harmonic_balance/noise_whitening.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/response_fits/maximum_likelihood.hpp"
#include "problems/base/error.hpp"

namespace graybox {

Eigen::MatrixXd output_level(const PeriodicData& data, std::size_t group) {
  Eigen::MatrixXd power =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(data.outputs.size()), data.last_line + 1);
  double count = 0.0;
  for (const auto* records : {&data.estimation, &data.validation}) {
    for (const MeasuredRecord& record : *records) {
      if (record.group != group) continue;
      power += record.output.cwiseAbs2();
      count += 1.0;
    }
  }
  return (power / std::max(count, 1.0)).cwiseSqrt();
}

std::optional<Eigen::MatrixXcd> whitening_of(Eigen::MatrixXcd covariance,
                                             const Eigen::VectorXd& level, double accuracy) {
  covariance.diagonal().real() += (accuracy * level).cwiseAbs2();
  const Eigen::LLT<Eigen::MatrixXcd> factor(covariance);
  if (factor.info() != Eigen::Success || !(covariance.diagonal().real().minCoeff() > 0.0)) {
    return {};
  }
  const Eigen::Index n = covariance.rows();
  return std::sqrt(2.0) * factor.matrixL().solve(Eigen::MatrixXcd::Identity(n, n));
}

std::vector<std::vector<Eigen::MatrixXcd>> whitening_between_lines(const PeriodicData& data,
                                                                   std::size_t groups,
                                                                   double accuracy) {
  using Eigen::Index;
  const auto outputs = static_cast<Index>(data.outputs.size());
  std::vector<std::vector<Eigen::MatrixXcd>> result(groups);
  for (std::size_t group = 0; group < groups; ++group) {
    const Eigen::MatrixXd level = output_level(data, group);
    result[group].resize(static_cast<std::size_t>(data.last_line) + 1);
    for (Index k = data.first_line; k <= data.last_line; ++k) {
      Eigen::MatrixXcd scatter = Eigen::MatrixXcd::Zero(outputs, outputs);
      double count = 0.0;
      for (const MeasuredRecord& record : data.estimation) {
        if (record.group != group || record.output_bins.size() == 0) continue;
        for (Index offset = 1; offset <= record.periods / 2; ++offset) {
          for (const Index bin : {k * record.periods - offset, k * record.periods + offset}) {
            if (bin >= record.output_bins.cols()) continue;
            scatter += record.output_bins.col(bin) * record.output_bins.col(bin).adjoint();
            count += 1.0;
          }
        }
      }
      // Not the shares that channels have in common: there may be fewer samples than channels.
      const Eigen::MatrixXcd covariance =
          Eigen::MatrixXcd((scatter / std::max(count, 1.0)).diagonal().asDiagonal());
      if (auto whitening = whitening_of(covariance, level.col(k), accuracy)) {
        result[group][static_cast<std::size_t>(k)] = std::move(*whitening);
      } else {
        throw InputError("an output has neither noise nor signal at some lines");
      }
    }
  }
  return result;
}

std::vector<std::vector<Eigen::MatrixXcd>> whitening_with_errors(const PeriodicData& data,
                                                                 double share) {
  auto result = data.whitening;
  for (std::size_t group = 0; group < result.size(); ++group) {
    const Eigen::MatrixXd level = output_level(data, group);
    for (Eigen::Index k = data.first_line; k <= data.last_line; ++k) {
      Eigen::MatrixXcd& whitening = result[group][static_cast<std::size_t>(k)];
      const Eigen::MatrixXcd covariance = 2.0 * (whitening.adjoint() * whitening).inverse();
      if (auto raised = whitening_of(covariance, level.col(k), share)) {
        whitening = std::move(*raised);
      }
    }
  }
  return result;
}

NoisePool pool_of(const std::vector<LineScatter>& lines,
                  const std::vector<OutputCovariance>& pooled) {
  NoisePool result{std::numeric_limits<double>::infinity(), 0.0, 0.0};
  result.own = independent_samples(lines);
  for (const OutputCovariance& one : pooled) {
    result.samples = std::min(result.samples, one.degrees_of_freedom);
    result.lines += static_cast<double>(one.pooled_lines) / static_cast<double>(pooled.size());
  }
  return result;
}

double inverse_bias(double degrees_of_freedom, Eigen::Index outputs) {
  const auto size = static_cast<double>(outputs);
  return degrees_of_freedom > size ? degrees_of_freedom / (degrees_of_freedom - size) : 1.0;
}

double half_variance(const NoisePool& pool, Eigen::Index outputs, double numbers, double channels,
                     double share_of_lines) {
  const auto n = static_cast<double>(outputs);
  const double q = std::max(pool.samples, n + 2.0);  // no moments below n + 1
  const double a = weights_widening(q, outputs), b = a * q / (q - n);
  const double samples = std::max(share_of_lines * pool.own, q);  // pooled beyond a few lines
  return numbers * a + numbers * numbers * b / (2.0 * channels * samples);
}

double effective_degrees_of_freedom(const PeriodicData& data,
                                    const std::vector<MeasuredRecord>& records,
                                    double degrees_of_freedom) {
  const auto outputs = static_cast<Eigen::Index>(data.outputs.size());
  std::vector<double> counts(data.noise_pools.size(), 0.0);  // records of each group
  for (const MeasuredRecord& record : records) {
    if (record.group >= counts.size() || !(data.noise_pools[record.group].own > 0.0)) {
      return degrees_of_freedom;
    }
    counts[record.group] += 1.0;
  }
  double variance = 0.0;  // half of it
  for (std::size_t group = 0; group < counts.size(); ++group) {
    if (counts[group] == 0.0) continue;
    const double numbers = degrees_of_freedom * counts[group] / static_cast<double>(records.size());
    variance +=
        half_variance(data.noise_pools[group], outputs, numbers, static_cast<double>(outputs), 1.0);
  }
  return degrees_of_freedom * degrees_of_freedom / variance;
}

}  // namespace graybox
