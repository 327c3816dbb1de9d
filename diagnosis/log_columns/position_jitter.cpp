#include "diagnosis/log_columns/position_jitter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The share of the steps' squares that is a sum of e from so many rows before to behind, less what
// as many columns of noise would take by chance.
double share_by_lags(const VectorXd& steps, const VectorXd& jitter) {
  constexpr Index kMostLag = 25, kRowsALag = 16;
  constexpr double kRidge = 1e-12;
  const Index lag = std::min(kMostLag, steps.size() / kRowsALag);
  const Index rows = steps.size() - 2 * lag, columns = 2 * lag + 1;
  MatrixXd around(rows, columns);
  for (Index k = 0; k < columns; ++k) around.col(k) = jitter.segment(k, rows);
  const VectorXd inner = steps.segment(lag, rows);
  const double squares = inner.squaredNorm();
  if (!(squares > 0.0)) return 0.0;
  MatrixXd normal = around.transpose() * around;
  normal.diagonal().array() += kRidge * normal.trace();
  const VectorXd values = normal.ldlt().solve(around.transpose() * inner);
  const double left = (inner - around * values).squaredNorm() / squares;
  return 1.0 - left * static_cast<double>(rows) / static_cast<double>(rows - columns);
}

}  // namespace

std::optional<PositionJitter> position_jitter(const VectorXd& position, const VectorXd& speed,
                                              double step) {
  constexpr Index kFewest = 100, kMost = 20000;
  constexpr double kOneShare = 0.5;  // of the squares, by a low pass
  const Index n = std::min(kMost, position.size());
  if (n < kFewest || position.size() != speed.size() || !(step > 0.0)) return {};
  const VectorXd place = position.head(n), rate = speed.head(n);
  if (!place.allFinite() || !rate.allFinite()) return {};
  const VectorXd steps = rate.tail(n - 1) - rate.head(n - 1);
  VectorXd jitter =
      (place.tail(n - 1) - place.head(n - 1)) / step - 0.5 * (rate.tail(n - 1) + rate.head(n - 1));
  jitter.array() -= jitter.mean();
  const double squares = jitter.squaredNorm(), of_steps = steps.squaredNorm();
  if (!(squares > 0.0) || !(of_steps > 0.0)) return {};
  const auto rows = static_cast<double>(n - 1);
  PositionJitter result;
  result.rate = std::sqrt(squares / rows);
  result.speed_noise = std::sqrt(0.5 * of_steps / rows);
  result.speed_deviation = std::sqrt((rate.array() - rate.mean()).square().mean());
  result.computed = share_by_lags(steps, jitter);
  const double along = steps.dot(jitter), share = along / squares;
  const bool is_low_pass = along * along > kOneShare * squares * of_steps;
  const double way = share / (1.0 + 0.5 * share);
  if (is_low_pass && way > 0.0 && way < 1.0) result.low_pass = way;
  return result;
}

}  // namespace graybox
