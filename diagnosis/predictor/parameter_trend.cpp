#include "diagnosis/predictor/parameter_trend.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <cmath>
#include <limits>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
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

VectorXd ParameterTrends::told(Index column) const {
  const Eigen::Map<const MatrixXd> own(fit_->jacobian.col(column).data(), outputs_,
                                       fit_->jacobian.rows() / outputs_);
  return own.colwise().squaredNorm().transpose();
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

namespace {

std::vector<TrendCovariate> covariates_at(const Location& place, const MatrixXd& motion,
                                          bool measures_position, const VectorXd& time) {
  std::vector<TrendCovariate> covariates{{LawTrend::On::kTime, time}};
  if (place.kind != LocationKind::kElement) return covariates;
  const Index coordinates = motion.cols() / 2;
  if (measures_position) {
    append_position_covariates(motion.leftCols(coordinates) * place.input, covariates);
  }
  append_rate_covariates(motion.rightCols(coordinates) * place.input, covariates);
  return covariates;
}

}  // namespace

std::vector<LawTrend> law_trends(const PredictionTask& task, Index outputs,
                                 const PredictionFit& fit, const MatrixXd& motion,
                                 std::span<const Hypothesis> hypotheses) {
  const ParameterTrends along(task, outputs, fit);
  const bool measures_position = fit.model.model.position_output.cwiseAbs().maxCoeff() > 0.0;
  std::vector<LawTrend> trends;
  for (std::size_t l = 0; l < fit.model.laws.size(); ++l) {
    const PlacedFinding& law = fit.model.laws[l];
    const Element& part = fit.model.model.parts[law.part];
    const std::vector<TrendCovariate> covariates =
        covariates_at(part.location, motion, measures_position, along.time());
    const std::size_t first = fit.model.first_parameter(law.part);
    const Hypothesis& hypothesis = hypotheses[law.hypothesis];
    const std::string law_at = fmt::format("{} at {}", hypothesis.law, hypothesis.place);
    LawTrend most{l, 0, LawTrend::On::kTime, 0.0, 0.0, 0.0, law_at, kUnknown};
    for (std::size_t i = 0; i < fit.free.size(); ++i) {
      if (fit.free[i] < first || fit.free[i] >= first + part.parameters.size()) continue;
      const ParameterSpace& space = fit.model.space[fit.free[i]];
      const double value = fit.model.model.parameters[fit.free[i]].value;
      const double unit = space.logarithmic ? std::abs(value) : space.scale;
      const VectorXd told = along.told(static_cast<Index>(i));
      for (const TrendCovariate& with : covariates) {
        if (with.values.size() != told.size()) continue;
        const ToldRange range(with.values, told);
        if (!range.is_wide()) continue;
        const ParameterTrend trend = along.with(with.values, static_cast<Index>(i));
        if (std::abs(trend.z) <= std::abs(most.z)) continue;
        const ToldRange::Ends ends = range.ends(value, unit * trend.slope);
        most = {l, fit.free[i] - first, with.on, ends.from, ends.to, trend.z, law_at, kUnknown};
      }
    }
    trends.push_back(most);
  }
  return trends;
}

}  // namespace graybox
