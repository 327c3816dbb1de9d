#include "diagnosis/periodic_pictures/residual_spectra.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>

#include "diagnosis/harmonic_balance/period_transform.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXd;

constexpr Index kShownPeriods = 8;  // channels along time

// Standard deviation of output c at line k, |X| of N^(-1/2) scaling: Phi = 2 (L^H L)^-1.
double noise_of(const PeriodicData& data, const MeasuredRecord& record, Index c, Index k) {
  const MatrixXcd& whitening = data.whitening[record.group][static_cast<std::size_t>(k)];
  const MatrixXcd covariance = 2.0 * (whitening.adjoint() * whitening).inverse();
  return std::sqrt(covariance(c, c).real());
}

// The record with the most signal above the noise in channel c; null if there are none.
const MeasuredRecord* clearest(const PeriodicData& data, const std::vector<MeasuredRecord>& records,
                               Index c) {
  const MeasuredRecord* best = nullptr;
  double most = -1.0;
  for (const MeasuredRecord& record : records) {
    double power = 0.0;
    for (const std::size_t line : data.excited) {
      const auto k = static_cast<Index>(line);
      power += std::norm(record.output(c, k) / noise_of(data, record, c, k));
    }
    if (power > most) {
      most = power;
      best = &record;
    }
  }
  return best;
}

std::string words_of(const PeriodicData& data, const MeasuredRecord& record) {
  const std::string& position = data.position_names[record.position];
  return fmt::format("{}{}level {:.4g}", position, position.empty() ? "" : ", ", record.level);
}

ResidualCurve spectrum(const PeriodicData& data, const MeasuredRecord& record,
                       const MatrixXcd& output, Index c) {
  ResidualCurve curve;
  const double scale = std::sqrt(2.0 / static_cast<double>(data.period));
  for (Index k = data.first_line; k <= data.last_line; ++k) {
    curve.axis.push_back(data.frequencies[static_cast<std::size_t>(k)] / (2.0 * std::numbers::pi));
    curve.measured.push_back(scale * std::abs(record.output(c, k)));
    curve.residual.push_back(scale * std::abs(record.output(c, k) - output(c, k)));
    curve.noise.push_back(scale * noise_of(data, record, c, k));
  }
  return curve;
}

ResidualCurve one_period(const PeriodicData& data, const MeasuredRecord& record,
                         const MatrixXcd& output, Index c) {
  ResidualCurve curve;
  curve.over_time = true;
  PeriodTransform transform(data.period, data.last_line,
                            fast_grid(2 * static_cast<std::size_t>(data.last_line) + 2));
  VectorXd measured(transform.grid()), modelled(transform.grid());
  // Only lines that count: others hold drift and what the model does not claim.
  Eigen::VectorXcd own = record.output.row(c).transpose(), model = output.row(c).transpose();
  own.head(data.first_line).setZero();
  model.head(data.first_line).setZero();
  transform.to_times(own, measured);
  transform.to_times(model, modelled);
  const double step =
      static_cast<double>(data.period) * data.sample_time / static_cast<double>(transform.grid());
  for (Index t = 0; t < transform.grid(); ++t) {
    curve.axis.push_back(static_cast<double>(t) * step);
    curve.measured.push_back(measured(t));
    curve.residual.push_back(measured(t) - modelled(t));
  }
  return curve;
}

}  // namespace

std::vector<ResidualCurve> residual_spectra(const PlantFamily& family, const PeriodicData& data,
                                            const ModelState& model) {
  SteadyStateSolver solver(family, data, {});
  std::vector<ResidualCurve> curves, periods;
  for (Index c = 0; c < static_cast<Index>(data.outputs.size()); ++c) {
    for (const auto* records : {&data.estimation, &data.validation}) {
      const MeasuredRecord* record = clearest(data, *records, c);
      if (record == nullptr) continue;
      const MatrixXcd output = solver.solve(model, *record, nullptr).output;
      const auto add = [&](ResidualCurve curve, std::vector<ResidualCurve>& list) {
        curve.channel = data.outputs[static_cast<std::size_t>(c)];
        curve.unit = data.output_units[static_cast<std::size_t>(c)];
        curve.experiment = words_of(data, *record);
        curve.held_out = records == &data.validation;
        curve.predicted_how = "in the steady state, lines that count";
        list.push_back(std::move(curve));
      };
      add(spectrum(data, *record, output, c), curves);
      if (c < kShownPeriods) add(one_period(data, *record, output, c), periods);
    }
  }
  curves.insert(curves.end(), periods.begin(), periods.end());
  return curves;
}

}  // namespace graybox
