#include "diagnosis/predictor/parameter_trend.hpp"

#include <Eigen/QR>
#include <cmath>
#include <vector>

#include "diagnosis/hypotheses/law_trend.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kImitated = 1e-4;  // of the direction's square: the parameters take all of it

MatrixXd basis_of(const MatrixXd& columns) {
  if (columns.size() == 0) return {};
  const VectorXd size = columns.colwise().norm().cwiseMax(1e-300);
  const MatrixXd scaled = columns * size.cwiseInverse().asDiagonal();
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(scaled);
  return qr.householderQ() * MatrixXd::Identity(columns.rows(), qr.rank());
}

}  // namespace

ParameterTrends::ParameterTrends(const PredictionTask& task, Index outputs,
                                 const PredictionFit& fit)
    : task_(&task), outputs_(outputs), fit_(&fit), basis_(basis_of(fit.jacobian)) {}

VectorXd ParameterTrends::time() const {
  std::vector<Index> samples;
  for (const PredictionRun& run : task_->runs) samples.push_back(run.samples);
  return time_covariate(samples);
}

ParameterTrend ParameterTrends::with(const VectorXd& covariate, Index column) const {
  const VectorXd& residuals = fit_->residuals;
  if (covariate.size() * outputs_ != residuals.size() || basis_.rows() != residuals.size() ||
      fit_->edges.size() < 2) {
    return {};
  }
  VectorXd d = fit_->jacobian.col(column);
  const double mean = covariate.mean();
  for (Index k = 0; k < covariate.size(); ++k) {
    d.segment(k * outputs_, outputs_) *= covariate(k) - mean;
  }
  const double moved = d.squaredNorm();
  d -= basis_ * (basis_.transpose() * d);
  const double square = d.squaredNorm();
  if (!(square > kImitated * moved)) return {};
  const double slope = -d.dot(residuals) / square;
  double variance = 0.0;  // of what the trend leaves: else a trend would pass for noise
  for (std::size_t b = 0; b + 1 < fit_->edges.size(); ++b) {
    const Index from = fit_->edges[b], count = fit_->edges[b + 1] - from;
    const auto own = d.segment(from, count);
    variance += std::pow(own.dot(residuals.segment(from, count) + slope * own), 2);
  }
  if (!(variance > 0.0)) return {};
  return {slope, slope * square / std::sqrt(variance)};
}

}  // namespace graybox
