#include "diagnosis/hypotheses/score_test.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>

#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

// A share of a column's squared length that rounding leaves after the nuisance has been taken out:
// products are formed in double precision, so 1e-10 of a square is noise of computation.
constexpr double kRoundingShare = 1e-9;

Eigen::VectorXd inverse_root_of_diagonal(const Eigen::MatrixXd& information) {
  return information.diagonal().unaryExpr(
      [](double value) { return value > 0.0 ? 1.0 / std::sqrt(value) : 0.0; });
}

// Rows u_i with sum u_i u_i^T = the pseudo-inverse of S, whose scale is that of `whole` before the
// projection.
Eigen::MatrixXd inverse_root(const Eigen::MatrixXd& projected, const Eigen::MatrixXd& whole) {
  const Eigen::VectorXd unit = inverse_root_of_diagonal(whole);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit.asDiagonal() * projected *
                                                             unit.asDiagonal());
  const Eigen::Index m = projected.rows();
  Eigen::Index rank = 0;
  for (Eigen::Index i = 0; i < m; ++i) rank += eigen.eigenvalues()(i) > kRoundingShare ? 1 : 0;
  Eigen::MatrixXd root(rank, m);
  for (Eigen::Index i = 0; i < rank; ++i) {
    const Eigen::Index k = m - rank + i;  // ascending order
    root.row(i) = (eigen.eigenvectors().col(k).cwiseProduct(unit)).transpose() /
                  std::sqrt(eigen.eigenvalues()(k));
  }
  return root;
}

}  // namespace

ScoreTest::ScoreTest(NuisanceProducts nuisance, const ResidualScale& scale)
    : nuisance_(std::move(nuisance)), scale_(scale) {
  const Eigen::Index p = nuisance_.information.rows();
  if (nuisance_.information.cols() != p || nuisance_.scores.rows() != p) {
    throw InputError("score test: the products of the fitted parameters differ in size");
  }
  unit_ = inverse_root_of_diagonal(nuisance_.information);
  if (p > 0) {
    factor_.setThreshold(kRoundingShare);
    factor_.compute(unit_.asDiagonal() * nuisance_.information * unit_.asDiagonal());
  }
}

ScoreTest::Projected ScoreTest::project(const CandidateProducts& candidate) const {
  const Eigen::Index m = candidate.information.rows();
  const Eigen::Index p = nuisance_.information.rows();
  if (candidate.information.cols() != m || candidate.nuisance.rows() != m ||
      candidate.nuisance.cols() != p || candidate.scores.rows() != m ||
      candidate.scores.cols() != nuisance_.scores.cols()) {
    throw InputError("score test: the products of a candidate differ in size from the parameters'");
  }
  Projected result;
  if (p == 0) {
    result.scores = candidate.scores;
    result.root = inverse_root(candidate.information, candidate.information);
    return result;
  }
  const Eigen::MatrixXd scaled = candidate.nuisance * unit_.asDiagonal();
  const Eigen::MatrixXd weights = factor_.solve(scaled.transpose()).transpose();
  Eigen::MatrixXd projected = candidate.information - weights * scaled.transpose();
  projected = (0.5 * (projected + projected.transpose())).eval();
  result.scores = candidate.scores - weights * (unit_.asDiagonal() * nuisance_.scores);
  result.root = inverse_root(projected, candidate.information);
  return result;
}

double ScoreTest::p_value(double statistic, double degrees_of_freedom, bool drawn) const {
  // Draws have variance one, estimated by nothing.
  if (!scale_.squared_sum || drawn) return chi_square_tail(statistic, degrees_of_freedom);
  const double rest = scale_.degrees_of_freedom - degrees_of_freedom;
  if (rest <= 0.0) return 1.0;
  const double unexplained = std::max(*scale_.squared_sum - statistic, 0.0);
  if (unexplained == 0.0) return 0.0;
  return fisher_tail((statistic / degrees_of_freedom) / (unexplained / rest), degrees_of_freedom,
                     rest);
}

CandidateScore ScoreTest::score(const CandidateProducts& candidate) const {
  const Projected projected = project(candidate);
  CandidateScore result;
  const Eigen::VectorXd white = projected.root * projected.scores.col(0);
  result.degrees_of_freedom = static_cast<double>(white.size());
  result.amplitudes = projected.root.transpose() * white;
  result.amplitude_covariance = projected.root.transpose() * projected.root;
  result.statistic = white.squaredNorm();
  if (white.size() > 0) {
    result.p_value = p_value(result.statistic, result.degrees_of_freedom, false);
  }
  return result;
}

void ScoreTest::lower_minimum_p_values(const CandidateProducts& candidate,
                                       const IsPossible& is_possible,
                                       std::span<double> minima) const {
  const Projected projected = project(candidate);
  const Eigen::Index rank = projected.root.rows();
  if (rank == 0) return;
  if (projected.scores.cols() != static_cast<Eigen::Index>(minima.size()) + 1) {
    throw InputError("score test: as many minima as draws are needed");
  }
  const Eigen::MatrixXd white =
      projected.root * projected.scores.rightCols(projected.scores.cols() - 1);
  for (Eigen::Index b = 0; b < white.cols(); ++b) {
    double& least = minima[static_cast<std::size_t>(b)];
    const double drawn = p_value(white.col(b).squaredNorm(), static_cast<double>(rank), true);
    if (drawn < least && is_possible(projected.root.transpose() * white.col(b))) least = drawn;
  }
}

double family_threshold(std::span<const double> minima, double level) {
  const double place = level * (static_cast<double>(minima.size()) + 1.0);
  if (place < 1.0) {
    throw InputError(fmt::format("{} draws are too few for a level of {:g}: take at least {:.0f}",
                                 minima.size(), level, std::ceil(1.0 / level - 1.0)));
  }
  std::vector<double> sorted(minima.begin(), minima.end());
  std::sort(sorted.begin(), sorted.end());
  const auto below = static_cast<std::size_t>(place);
  if (below >= sorted.size()) return sorted.back();
  const double share = place - static_cast<double>(below);
  return (1.0 - share) * sorted[below - 1] + share * sorted[below];
}

double canonical_correlation_squared(const NuisanceProducts& nuisance,
                                     const CandidateProducts& first,
                                     const CandidateProducts& second,
                                     const Eigen::MatrixXd& cross) {
  // One candidate of both, so that the projection is written once.
  const Eigen::Index m1 = first.information.rows();
  const Eigen::Index m2 = second.information.rows();
  if (cross.rows() != m1 || cross.cols() != m2) {
    throw InputError("canonical correlation: the cross product differs in size");
  }
  const Eigen::VectorXd unit = inverse_root_of_diagonal(nuisance.information);
  const Eigen::MatrixXd scaled_1 = first.nuisance * unit.asDiagonal();
  const Eigen::MatrixXd scaled_2 = second.nuisance * unit.asDiagonal();
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factor;
  Eigen::MatrixXd own_1 = first.information;
  Eigen::MatrixXd own_2 = second.information;
  Eigen::MatrixXd between = cross;
  if (nuisance.information.rows() > 0) {
    factor.setThreshold(kRoundingShare);
    factor.compute(unit.asDiagonal() * nuisance.information * unit.asDiagonal());
    const Eigen::MatrixXd weights = factor.solve(scaled_2.transpose());
    own_1 -= scaled_1 * factor.solve(scaled_1.transpose());
    own_2 -= scaled_2 * weights;
    between -= scaled_1 * weights;
  }
  const Eigen::MatrixXd root_1 = inverse_root(own_1, first.information);
  const Eigen::MatrixXd root_2 = inverse_root(own_2, second.information);
  if (root_1.rows() == 0 || root_2.rows() == 0) return 0.0;
  const Eigen::MatrixXd correlation = root_1 * between * root_2.transpose();
  const double largest = Eigen::JacobiSVD<Eigen::MatrixXd>(correlation).singularValues()(0);
  return std::min(1.0, largest * largest);
}

}  // namespace graybox
