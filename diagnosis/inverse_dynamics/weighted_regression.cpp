#include "diagnosis/inverse_dynamics/weighted_regression.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "diagnosis/estimation/recording_spread.hpp"
#include "diagnosis/signals/long_run_variance.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr int kMaxIterations = 50;
constexpr double kWeightTolerance = 1e-8;  // relative change of the noise
constexpr double kNoiseFloor = 1e-9;       // of the torque's root mean square

Eigen::VectorXd torque_rms(const TorqueRows& rows) {
  const Eigen::Map<const Eigen::MatrixXd> torque(rows.torque.data(), rows.joints, rows.samples());
  Eigen::VectorXd rms =
      (torque.rowwise().squaredNorm() / static_cast<double>(rows.samples())).cwiseSqrt();
  const double largest = rms.maxCoeff();
  return (rms.array() > 0.0).select(rms, largest > 0.0 ? largest : 1.0);
}

Eigen::VectorXd joint_noise(const TorqueRows& rows, const Eigen::VectorXd& residuals,
                            const Eigen::VectorXd& rms, JointNoise kind) {
  const Eigen::Map<const Eigen::MatrixXd> errors(residuals.data(), rows.joints, rows.samples());
  const auto parameters = static_cast<double>(rows.columns.cols());
  const double freedom =
      static_cast<double>(rows.samples()) - parameters / static_cast<double>(rows.joints);
  Eigen::VectorXd variance = errors.rowwise().squaredNorm() / freedom;
  if (kind == JointNoise::kEqual) variance.setConstant(variance.mean());
  return variance.cwiseSqrt().cwiseMax(kNoiseFloor * rms);
}

// Times x parameters.
Eigen::MatrixXd scores(const TorqueRows& rows, const Eigen::VectorXd& residuals,
                       const Eigen::VectorXd& noise) {
  const Eigen::VectorXd weights = row_weights(noise, rows.torque.size());
  const Eigen::VectorXd weighted = residuals.cwiseProduct(weights.cwiseAbs2());
  Eigen::MatrixXd result(rows.samples(), rows.columns.cols());
  for (Index t = 0; t < rows.samples(); ++t) {
    result.row(t) = weighted.segment(t * rows.joints, rows.joints).transpose() *
                    rows.columns.middleRows(t * rows.joints, rows.joints);
  }
  return result;
}

// Sums of the scores by recording.
Eigen::MatrixXd recording_sums(const TorqueRows& rows, const Eigen::MatrixXd& scores) {
  if (rows.piece_recordings.empty()) return Eigen::MatrixXd(0, scores.cols());
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(rows.piece_recordings.back() + 1, scores.cols());
  Index first = 0;
  for (std::size_t piece = 0; piece < rows.piece_samples.size(); ++piece) {
    const Index length = rows.piece_samples[piece];
    sums.row(rows.piece_recordings[piece]) += scores.middleRows(first, length).colwise().sum();
    first += length;
  }
  return sums;
}

double scaled_condition(const TorqueRows& rows, const Eigen::VectorXd& noise) {
  Eigen::MatrixXd scaled = row_weights(noise, rows.torque.size()).asDiagonal() * rows.columns;
  scaled.array().rowwise() /= scaled.colwise().norm().array().eval();
  // The triangle has the columns' singular values. The general decompositions of Eigen would take a
  // minute to compile.
  const Eigen::HouseholderQR<Eigen::MatrixXd> factor(scaled);
  const Index p = scaled.cols();
  const Eigen::MatrixXd triangle = factor.matrixQR().topRows(p).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<Eigen::MatrixXd, Eigen::NoQRPreconditioner> svd(triangle);
  return svd.singularValues()(0) / svd.singularValues()(p - 1);
}

WeightedRegression without_parameters(const TorqueRows& rows, const Eigen::VectorXd& rms,
                                      JointNoise kind) {
  WeightedRegression fit;
  fit.residuals = rows.torque;
  fit.noise = joint_noise(rows, fit.residuals, rms, kind);
  fit.condition = 1.0;
  fit.converged = true;
  return fit;
}

}  // namespace

Index andrews_lags(const Eigen::VectorXd& correlations, Index samples) {
  double numerator = 0.0, denominator = 0.0;
  for (const double r : correlations) {
    const double spread = (1.0 - r * r) * (1.0 - r * r) / std::pow(1.0 - r, 4.0);
    numerator += spread * 4.0 * r * r / ((1.0 - r) * (1.0 - r) * (1.0 + r) * (1.0 + r));
    denominator += spread;
  }
  const double ratio = numerator / denominator * static_cast<double>(samples);
  return std::min(static_cast<Index>(1.1447 * std::cbrt(ratio)), samples / 4);
}

Eigen::VectorXd row_weights(const Eigen::VectorXd& noise, Index rows) {
  return noise.cwiseInverse().replicate(rows / noise.size(), 1);
}

Eigen::VectorXd solve_weighted(const TorqueRows& rows, const Eigen::VectorXd& noise) {
  if (rows.columns.cols() == 0) return {};
  const Eigen::VectorXd weights = row_weights(noise, rows.torque.size());
  Eigen::MatrixXd scaled = weights.asDiagonal() * rows.columns;
  const Eigen::RowVectorXd lengths = scaled.colwise().norm();
  scaled.array().rowwise() /= lengths.array();
  const Eigen::VectorXd solution =
      scaled.householderQr().solve(weights.cwiseProduct(rows.torque).eval());
  return solution.cwiseQuotient(lengths.transpose());
}

Eigen::MatrixXd correlated_covariance(const TorqueRows& rows, const Eigen::VectorXd& residuals,
                                      const Eigen::VectorXd& noise, Index& lags) {
  Eigen::MatrixXd scaled = row_weights(noise, rows.torque.size()).asDiagonal() * rows.columns;
  const Eigen::VectorXd lengths = scaled.colwise().norm();
  scaled.array().rowwise() /= lengths.transpose().array();
  const Eigen::MatrixXd bread = (scaled.transpose() * scaled)
                                    .ldlt()
                                    .solve(Eigen::MatrixXd::Identity(scaled.cols(), scaled.cols()));
  Eigen::MatrixXd g = scores(rows, residuals, noise);
  g.array().rowwise() /= lengths.transpose().array();
  const PrewhitenedScores whitened(g, rows.piece_samples);
  lags = andrews_lags(whitened.whitened_correlations(), whitened.samples());
  const Eigen::MatrixXd spectrum = whitened.long_run_variance(lags);
  const auto count = static_cast<double>(rows.torque.size());
  const double correction = count / (count - static_cast<double>(rows.columns.cols()));
  const Eigen::MatrixXd covariance = widened(correction * bread * spectrum * bread,
                                             deviations_between(recording_sums(rows, g) * bread));
  const Eigen::VectorXd inverse = lengths.cwiseInverse();
  return inverse.asDiagonal() * (0.5 * (covariance + covariance.transpose())) *
         inverse.asDiagonal();
}

WeightedRegression weighted_regression(const TorqueRows& rows, JointNoise kind) {
  WeightedRegression fit;
  Eigen::VectorXd rms = torque_rms(rows);
  if (kind == JointNoise::kEqual) rms.setConstant(rms.maxCoeff());
  fit.noise = rms;
  if (rows.columns.cols() == 0) return without_parameters(rows, rms, kind);
  while (!fit.converged && fit.iterations < kMaxIterations) {
    ++fit.iterations;
    fit.parameters = solve_weighted(rows, fit.noise);
    fit.residuals = rows.torque - rows.columns * fit.parameters;
    const Eigen::VectorXd noise = joint_noise(rows, fit.residuals, rms, kind);
    fit.converged =
        ((noise - fit.noise).array() / noise.array()).abs().maxCoeff() < kWeightTolerance;
    fit.noise = noise;
  }
  fit.covariance = correlated_covariance(rows, fit.residuals, fit.noise, fit.lags);
  fit.condition = scaled_condition(rows, fit.noise);
  return fit;
}

}  // namespace graybox
