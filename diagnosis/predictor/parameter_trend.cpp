#include "diagnosis/predictor/parameter_trend.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kImitated = 1e-4;  // of the direction's square: the parameters take all of it

// tau of each row.
VectorXd times_of(const PredictionTask& task, Index outputs, Index rows) {
  Index longest = 1;
  for (const PredictionRun& run : task.runs) longest = std::max(longest, run.samples);
  VectorXd times(rows);
  Index row = 0;
  for (const PredictionRun& run : task.runs) {
    const double middle = 0.5 * static_cast<double>(run.samples - 1);
    for (Index k = 0; k < run.samples; ++k) {
      const double tau = (static_cast<double>(k) - middle) / static_cast<double>(longest);
      times.segment(row, outputs).setConstant(tau);
      row += outputs;
    }
  }
  return times;
}

// `values` beside the space of the columns.
VectorXd beside(const MatrixXd& columns, const VectorXd& values) {
  const VectorXd size = columns.colwise().norm().cwiseMax(1e-300);
  const MatrixXd scaled = columns * size.cwiseInverse().asDiagonal();
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(scaled);
  VectorXd rotated = qr.householderQ().adjoint() * values;
  rotated.head(qr.rank()).setZero();
  return qr.householderQ() * rotated;
}

}  // namespace

ParameterTrend parameter_trend(const PredictionTask& task, Index outputs, const PredictionFit& fit,
                               Index column) {
  const Index rows = fit.residuals.size();
  if (fit.jacobian.rows() != rows || rows == 0 || fit.edges.size() < 2) return {};
  const VectorXd moved = times_of(task, outputs, rows).cwiseProduct(fit.jacobian.col(column));
  const VectorXd d = beside(fit.jacobian, moved);
  const double square = d.squaredNorm();
  if (!(square > kImitated * moved.squaredNorm())) return {};
  const double change = -d.dot(fit.residuals) / square;
  double variance = 0.0;  // of what the trend leaves: else a trend would pass for noise
  for (std::size_t b = 0; b + 1 < fit.edges.size(); ++b) {
    const Index from = fit.edges[b], count = fit.edges[b + 1] - from;
    const auto own = d.segment(from, count);
    variance += std::pow(own.dot(fit.residuals.segment(from, count) + change * own), 2);
  }
  if (!(variance > 0.0)) return {};
  return {change, change * square / std::sqrt(variance)};
}

}  // namespace graybox
