#include "diagnosis/force_balance_data/held_commands.hpp"

#include <Eigen/Dense>
#include <array>
#include <cmath>

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kColumns = 4, kTargets = 2, kBlocks = 20;
constexpr double kErrors = 4.0;

using Columns = Eigen::Vector<double, kColumns>;
using Targets = Eigen::RowVector<double, kTargets>;

Columns columns_at(const Motion& piece, Index k) {
  const double rate = piece.velocity(k, 0);
  return {piece.acceleration(k, 0), rate, static_cast<double>((rate > 0.0) - (rate < 0.0)), 1.0};
}

Targets targets_at(const Motion& piece, Index k) {
  const auto force = piece.torque.col(0);
  return {(force(k - 1) + force(k)) / 2.0, (force(k - 1) + 4.0 * force(k) + force(k + 1)) / 6.0};
}

template <typename Visit>
void visit_fitted(const std::vector<MotionRecord>& records, const Visit& visit) {
  for (const MotionRecord& record : records) {
    if (record.role != ExperimentRole::kEstimation) continue;
    for (const Motion& piece : record.pieces) {
      for (Index k = 1; k + 1 < piece.samples(); ++k) visit(piece, k);
    }
  }
}

// By how many standard errors the sums of squares of the blocks differ, the second's greater.
double errors_apart(const std::array<Targets, kBlocks>& squares) {
  Eigen::Vector<double, kBlocks> more;
  for (Index b = 0; b < kBlocks; ++b) {
    const Targets& block = squares[static_cast<std::size_t>(b)];
    more(b) = block(1) - block(0);
  }
  const double mean = more.mean();
  const double spread = (more.array() - mean).square().sum() / (kBlocks - 1.0);
  return spread > 0.0 ? mean / std::sqrt(spread / kBlocks) : 0.0;
}

}  // namespace

bool are_held_commands(const std::vector<MotionRecord>& records) {
  Eigen::Matrix<double, kColumns, kColumns> products;
  Eigen::Matrix<double, kColumns, kTargets> right;
  products.setZero();
  right.setZero();
  Index samples = 0;
  visit_fitted(records, [&](const Motion& piece, Index k) {
    const Columns row = columns_at(piece, k);
    products += row * row.transpose();
    right += row * targets_at(piece, k);
    ++samples;
  });
  if (samples < kBlocks) return false;
  const Eigen::Matrix<double, kColumns, kTargets> fitted =
      products.completeOrthogonalDecomposition().solve(right);
  std::array<Targets, kBlocks> squares;
  squares.fill(Targets::Zero());
  Index sample = 0;
  visit_fitted(records, [&](const Motion& piece, Index k) {
    const Targets rest = targets_at(piece, k) - columns_at(piece, k).transpose() * fitted;
    squares[static_cast<std::size_t>(sample++ * kBlocks / samples)] += rest.cwiseAbs2();
  });
  return errors_apart(squares) > kErrors;
}

void take_means_of_held(std::vector<MotionRecord>& records) {
  for (MotionRecord& record : records) {
    for (Motion& piece : record.pieces) {
      const Index pairs = piece.samples() - 1;
      const Eigen::MatrixXd force = piece.torque;
      piece.torque.bottomRows(pairs) = 0.5 * (force.topRows(pairs) + force.bottomRows(pairs));
    }
  }
}

}  // namespace graybox
