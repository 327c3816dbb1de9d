#include "graybox/diagnosis/output_error/output_error_covariance.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

// Below this a combination of parameters changes nothing but rounding.
constexpr double kSeen = 1e-6;
// Andrews and Monahan's bound on the whitening of scores.
constexpr double kMostCorrelated = 0.97;

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

double lag_one(const Eigen::VectorXd& values) {
  const double square = values.squaredNorm();
  return square > 0.0 ? values.head(values.size() - 1).dot(values.tail(values.size() - 1)) / square
                      : 0.0;
}

// Andrews 1991, (6.2) with (6.4) of one series: 1.1447 (alpha n)^(1/3), alpha = 4 rho^2/(1 - rho^2)^2.
Eigen::Index lags_for(const Eigen::MatrixXd& scores) {
  double largest = 0.0;
  for (Eigen::Index i = 0; i < scores.cols(); ++i) {
    const double rho = std::min(std::abs(lag_one(scores.col(i))), kMostCorrelated);
    largest = std::max(largest, 4.0 * rho * rho / std::pow(1.0 - rho * rho, 2));
  }
  const auto n = static_cast<double>(scores.rows());
  return std::clamp<Eigen::Index>(
      static_cast<Eigen::Index>(std::ceil(1.1447 * std::cbrt(largest * n))), 0, scores.rows() / 4);
}

// sum_t g_t g_t^T + sum_l (1 - l/(L + 1)) sum_t (g_t g_(t+l)^T + its transpose), of the scores
// whitened by h_t = g_t - R g_(t-1), R the diagonal of their lag-one correlations, and coloured again:
// (I - R)^-1 V (I - R)^-1 (Andrews and Monahan, Econometrica 60, 1992).
Eigen::MatrixXd long_run_variance(const Eigen::MatrixXd& scores) {
  const Eigen::Index n = scores.rows() - 1, p = scores.cols();
  Eigen::VectorXd correlation(p);
  for (Eigen::Index i = 0; i < p; ++i) {
    correlation(i) = std::clamp(lag_one(scores.col(i)), -kMostCorrelated, kMostCorrelated);
  }
  const Eigen::MatrixXd whitened =
      scores.bottomRows(n) - scores.topRows(n) * correlation.asDiagonal();
  const Eigen::Index lags = lags_for(whitened);
  Eigen::MatrixXd sum = whitened.transpose() * whitened;
  for (Eigen::Index l = 1; l <= lags; ++l) {
    const double weight = 1.0 - static_cast<double>(l) / static_cast<double>(lags + 1);
    const Eigen::MatrixXd cross = whitened.topRows(n - l).transpose() * whitened.bottomRows(n - l);
    sum += weight * (cross + cross.transpose());
  }
  const Eigen::VectorXd colour = (1.0 - correlation.array()).inverse().matrix();
  const double all_samples = static_cast<double>(n + 1) / static_cast<double>(n);
  return all_samples * (colour.asDiagonal() * sum * colour.asDiagonal());
}

// "0.7 load.inertia - 0.7 motor.inertia", of parameters scaled to equal effect.
std::string combination(const Eigen::VectorXd& direction, const OutputErrorProblem& problem) {
  std::string text;
  const double largest = direction.cwiseAbs().maxCoeff();
  for (Eigen::Index i = 0; i < direction.size(); ++i) {
    if (std::abs(direction(i)) < 0.1 * largest) continue;
    const std::size_t index = problem.free_parameters()[static_cast<std::size_t>(i)];
    const std::string& name = problem.model().parameters[index].name;
    const char* sign = direction(i) < 0.0 ? (text.empty() ? "-" : " - ")
                       : text.empty()     ? ""
                                          : " + ";
    text += fmt::format("{}{:.2g} {}", sign, std::abs(direction(i)), name);
  }
  return text;
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
  double square = 0.0, cross = 0.0;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Whitened part = whiten(problem, stretches[k], runs[k], deviation, initial_is_free);
    normal += part.jacobian.transpose() * part.jacobian;
    spread += long_run_variance(scores_of(part, ny));
    const Eigen::Index later = part.residual.size() - ny;
    square += part.residual.squaredNorm();
    if (later > 0) cross += part.residual.head(later).dot(part.residual.tail(later));
  }
  result.lag_one_correlation = square > 0.0 ? cross / square : 0.0;
  // Columns of equal length: the rank does not depend on units.
  Eigen::VectorXd scale = normal.diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < p; ++i) {
    if (scale(i) > 0.0) continue;
    const std::size_t index = problem.free_parameters()[static_cast<std::size_t>(i)];
    result.unseen.push_back(problem.model().parameters[index].name + " changes nothing");
    scale(i) = 1.0;
  }
  const Eigen::VectorXd inverse_scale = scale.cwiseInverse();
  const Eigen::MatrixXd scaled = inverse_scale.asDiagonal() * normal * inverse_scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  result.singular_values = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  const bool all_move = result.unseen.empty();
  for (Eigen::Index i = 0; all_move && i < p; ++i) {
    if (result.singular_values(i) > kSeen) continue;
    // In the parameters' own units a step along it is weighted by their values.
    const Eigen::VectorXd step = inverse_scale.cwiseProduct(eigen.eigenvectors().col(i));
    Eigen::VectorXd relative = step.cwiseQuotient(theta.cwiseAbs().cwiseMax(1e-300));
    relative /= relative.norm();
    result.unseen.push_back("relative changes " + combination(relative, problem) +
                            " together change nothing");
  }
  if (!result.unseen.empty()) return result;
  const Eigen::MatrixXd inverse = inverse_scale.asDiagonal() * eigen.eigenvectors() *
                                  eigen.eigenvalues().cwiseInverse().asDiagonal() *
                                  eigen.eigenvectors().transpose() * inverse_scale.asDiagonal();
  result.white = variance * inverse;
  result.robust = inverse * spread * inverse;
  return result;
}

}  // namespace graybox
