#include "diagnosis/output_error/output_error_covariance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "diagnosis/estimation/recording_spread.hpp"
#include "diagnosis/signals/long_run_variance.hpp"

namespace graybox {
namespace {

// One stretch: J less what initial states explain, and r; rows sample by sample.
struct Whitened {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residual;
};

Whitened whiten(const OutputErrorProblem& problem, const StretchOf& stretch, const Simulated& run,
                const Eigen::VectorXd& deviation, bool initial_is_free) {
  const auto p = static_cast<Eigen::Index>(problem.free_parameters().size());
  const Eigen::VectorXd weights =
      deviation.cwiseInverse().replicate(run.outputs.rows() / deviation.size(), 1);
  Whitened result{weights.asDiagonal() * run.outputs.middleCols(1, p),
                  weights.cwiseProduct(run.outputs.col(0) - problem.measured(stretch))};
  if (!initial_is_free || problem.initial_size() == 0) return result;
  const Eigen::MatrixXd initial =
      weights.asDiagonal() * run.outputs.rightCols(problem.initial_size());
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(initial);
  result.jacobian -= initial * solver.solve(result.jacobian);
  return result;
}

// Scores g_t = J_t^T r_t of one sample, all outputs together: samples x p.
Eigen::MatrixXd scores_of(const Whitened& part, Eigen::Index outputs) {
  const Eigen::Index samples = part.residual.size() / outputs;
  Eigen::MatrixXd scores(samples, part.jacobian.cols());
  for (Eigen::Index t = 0; t < samples; ++t) {
    scores.row(t) = part.residual.segment(t * outputs, outputs).transpose() *
                    part.jacobian.middleRows(t * outputs, outputs);
  }
  return scores;
}

// Andrews 1991, (6.2) with (6.4) of one series, the most correlated: 1.1447 (alpha n)^(1/3),
// alpha = 4 rho^2/(1 - rho^2)^2.
Eigen::Index lags_for(const Eigen::VectorXd& correlations, Eigen::Index samples) {
  const double rho = correlations.cwiseAbs().maxCoeff();
  const double alpha = 4.0 * rho * rho / std::pow(1.0 - rho * rho, 2);
  return std::clamp<Eigen::Index>(static_cast<Eigen::Index>(std::ceil(
                                      1.1447 * std::cbrt(alpha * static_cast<double>(samples)))),
                                  0, samples / 4);
}

// Of the sum of all scores; prewhitening loses the first.
Eigen::MatrixXd long_run_variance(const Eigen::MatrixXd& scores) {
  const PrewhitenedScores whitened(scores, {scores.rows()});
  const Eigen::Index lags = lags_for(whitened.whitened_correlations(), whitened.samples());
  const double all_samples =
      static_cast<double>(scores.rows()) / static_cast<double>(whitened.samples());
  return all_samples * whitened.long_run_variance(lags);
}

// Whether the scores' own memory is a lower bound only: what is left may drift for as long as the
// recording lasts, and its long-run variance is then not seen in samples that follow each other.
constexpr double kDriftingCorrelation = 0.5;
constexpr Eigen::Index kBatches = 8;  // of all recordings together

// Sums over equal batches of neighbouring samples, a row each.
Eigen::MatrixXd batch_sums(const Eigen::MatrixXd& scores, Eigen::Index batches) {
  Eigen::MatrixXd sums(batches, scores.cols());
  for (Eigen::Index b = 0; b < batches; ++b) {
    const Eigen::Index begin = b * scores.rows() / batches;
    const Eigen::Index end = (b + 1) * scores.rows() / batches;
    sums.row(b) = scores.middleRows(begin, end - begin).colwise().sum();
  }
  return sums;
}

}  // namespace

OutputErrorCovariance output_error_covariance(const OutputErrorProblem& problem,
                                              std::span<const StretchOf> stretches,
                                              std::span<const Simulated> runs,
                                              const Eigen::VectorXd& theta,
                                              const Eigen::VectorXd& deviation,
                                              bool initial_is_free, double variance) {
  const Eigen::Index p = theta.size(), ny = deviation.size();
  OutputErrorCovariance result;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(p, p), spread = normal;
  const auto recordings = static_cast<Eigen::Index>(runs.size());
  const Eigen::Index parts = std::max<Eigen::Index>(1, kBatches / recordings);
  Eigen::MatrixXd sums(recordings, p), batches(recordings * parts, p);  // of the scores
  double square = 0.0, cross = 0.0;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Whitened part = whiten(problem, stretches[k], runs[k], deviation, initial_is_free);
    normal += part.jacobian.transpose() * part.jacobian;
    const Eigen::MatrixXd scores = scores_of(part, ny);
    spread += long_run_variance(scores);
    const auto row = static_cast<Eigen::Index>(k);
    sums.row(row) = scores.colwise().sum();
    batches.middleRows(row * parts, parts) = batch_sums(scores, parts);
    const Eigen::Index later = part.residual.size() - ny;
    square += part.residual.squaredNorm();
    if (later > 0) cross += part.residual.head(later).dot(part.residual.tail(later));
  }
  result.lag_one_correlation = square > 0.0 ? cross / square : 0.0;
  std::vector<std::string> names;
  for (const std::size_t k : problem.free_parameters()) {
    names.push_back(problem.model().parameters[k].name);
  }
  result.identifiability = examine_identifiability(normal / variance, theta, names);
  if (std::ranges::any_of(result.identifiability.relative_standard_errors,
                          [](double s) { return std::isinf(s); })) {
    return result;
  }
  // Columns of equal length: the inverse does not depend on units.
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::MatrixXd inverse = scale.asDiagonal() *
                                  scaled.ldlt().solve(Eigen::MatrixXd::Identity(p, p)) *
                                  scale.asDiagonal();
  result.white = variance * inverse;
  const Eigen::MatrixXd within = inverse * spread * inverse;
  result.robust = widened(within, deviations_between(sums * inverse));
  if (std::abs(result.lag_one_correlation) > kDriftingCorrelation) {
    result.robust = widened(result.robust, deviations_between(batches * inverse));
  }
  const Eigen::VectorXd widening =
      result.robust.diagonal().cwiseQuotient(within.diagonal()).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd robust_information = widening.asDiagonal() * normal *
                                             spread.ldlt().solve(Eigen::MatrixXd(normal)) *
                                             widening.asDiagonal();
  if (robust_information.allFinite()) {
    result.identifiability = examine_identifiability(
        0.5 * (robust_information + robust_information.transpose()), theta, names);
  }
  return result;
}

}  // namespace graybox
