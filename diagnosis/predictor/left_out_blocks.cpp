#include "diagnosis/predictor/left_out_blocks.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace graybox {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kLongestStep = 4.0;  // standard deviations a parameter
constexpr double kLeast = 1e-300;

// Beside the columns of `local`; one of zeros (a state that no output shows) takes nothing.
MatrixXd beside(const MatrixXd& local, const MatrixXd& values) {
  const VectorXd size = local.colwise().norm().transpose();
  std::vector<Index> shown;
  for (Index c = 0; c < size.size(); ++c) {
    if (size(c) > 0.0) shown.push_back(c);
  }
  if (shown.empty() || values.cols() == 0) return values;
  const MatrixXd scaled = local(Eigen::all, shown) * size(shown).cwiseInverse().asDiagonal();
  return values - scaled * scaled.colPivHouseholderQr().solve(values);
}

// The variance of the sum of values about zero that are correlated with their neighbours.
double long_run_sum(const VectorXd& values) {
  constexpr double kLeastOfPlain = 0.3;  // of the variance without correlations
  constexpr Index kBlocksPerLag = 32;    // of fine blocks
  const double plain = values.squaredNorm();
  const Index lags = std::max<Index>(2, values.size() / kBlocksPerLag);
  double variance = plain;
  for (Index lag = 1; lag <= lags; ++lag) {
    const Index count = values.size() - lag;
    if (count < 2) break;
    variance += 2.0 * (1.0 - static_cast<double>(lag) / static_cast<double>(lags + 1)) *
                values.head(count).dot(values.tail(count));
  }
  return std::max(variance, kLeastOfPlain * plain);
}

// The normal quantile of the same probability as a value of Student's t.
double normal_quantile(double t, double freedom) {
  return t * (1.0 - 1.0 / (4.0 * freedom)) / std::sqrt(1.0 + t * t / (2.0 * freedom));
}

}  // namespace

BlockEdges block_edges(const std::vector<Index>& unit_starts, Index rows, Index most_blocks) {
  const auto units = static_cast<Index>(unit_starts.size());
  const Index blocks = std::min(most_blocks, units);
  BlockEdges edges;
  for (Index b = 0; b < blocks; ++b) {
    edges.push_back(unit_starts[static_cast<std::size_t>(units * b / blocks)]);
  }
  edges.push_back(rows);
  return edges;
}

VectorXd left_out_residuals(const VectorXd& all_residuals, const MatrixXd& all_columns,
                            const BlockEdges& edges, Index local, double variance) {
  const Index p = all_columns.cols() - local;
  const MatrixXd own = all_columns.rightCols(local);
  const VectorXd residuals = beside(own, all_residuals);
  const MatrixXd jacobian = beside(own, all_columns.leftCols(p));
  const auto blocks = static_cast<Index>(edges.size()) - 1;
  VectorXd result = VectorXd::Zero(residuals.size());
  MatrixXd normal = jacobian.transpose() * jacobian;
  normal.diagonal().array() += variance;
  // Columns of one size, and a ridge for those that the data do not see.
  const VectorXd size = normal.diagonal().cwiseSqrt().cwiseMax(1e-300);
  const VectorXd scale = size.cwiseInverse();
  normal = scale.asDiagonal() * normal * scale.asDiagonal();
  normal.diagonal().array() += 1e-10;
  for (Index b = 0; b < blocks; ++b) {
    const Index from = edges[static_cast<std::size_t>(b)];
    const Index count = edges[static_cast<std::size_t>(b) + 1] - from;
    VectorXd left = residuals.segment(from, count);
    if (p > 0) {
      const MatrixXd block = jacobian.middleRows(from, count) * scale.asDiagonal();
      const MatrixXd others = normal - block.transpose() * block;
      VectorXd change = others.ldlt().solve(block.transpose() * left);
      const double length = change.dot(normal * change);
      const double limit = kLongestStep * kLongestStep * static_cast<double>(p) * variance;
      if (variance > 0.0 && length > limit) change *= std::sqrt(limit / length);
      if (change.allFinite()) left += block * change;
    }
    result.segment(from, count) = left;
  }
  return result;
}

VectorXd block_squares(const VectorXd& residuals, const BlockEdges& edges) {
  VectorXd squares(static_cast<Index>(edges.size()) - 1);
  for (std::size_t b = 0; b + 1 < edges.size(); ++b) {
    squares(static_cast<Index>(b)) =
        residuals.segment(edges[b], edges[b + 1] - edges[b]).squaredNorm();
  }
  return squares;
}

double left_out_z(const VectorXd& poorer, const VectorXd& richer, double rows) {
  const VectorXd gain =
      0.5 * rows * (poorer.array().max(kLeast).log() - richer.array().max(kLeast).log()).matrix();
  const auto blocks = static_cast<double>(gain.size());
  const double mean = gain.mean();
  const double variance = long_run_sum(gain.array() - mean) / blocks;
  return normal_quantile(mean / std::sqrt(variance / blocks + kLeast), std::max(blocks - 1.0, 1.0));
}

double added_z(const VectorXd& poorer, const VectorXd& richer, const BlockEdges& edges) {
  const auto blocks = static_cast<Index>(edges.size()) - 1;
  VectorXd noise(blocks);
  double gain = 0.0;
  for (Index b = 0; b < blocks; ++b) {
    const Index from = edges[static_cast<std::size_t>(b)];
    const Index count = edges[static_cast<std::size_t>(b) + 1] - from;
    const auto before = poorer.segment(from, count), after = richer.segment(from, count);
    gain += before.squaredNorm() - after.squaredNorm();
    noise(b) = 2.0 * (before - after).dot(after);
  }
  const double squares = noise.squaredNorm(), fourth = noise.array().square().square().sum();
  if (!(fourth > 0.0)) return 0.0;
  return normal_quantile(gain / std::sqrt(long_run_sum(noise)), squares * squares / fourth);
}

}  // namespace graybox
