#include "diagnosis/force_balance/remaining_structure.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <vector>

namespace graybox {
namespace {

constexpr Eigen::Index kBins = 16;
constexpr Eigen::Index kFolds = 5;

// Contiguous fifths of consecutive samples: the fold of each.
Eigen::Index fold_of(Eigen::Index sample, Eigen::Index samples) {
  return std::min(kFolds - 1, sample * kFolds / std::max<Eigen::Index>(1, samples));
}

// The bin of each value, edges at quantiles.
std::vector<Eigen::Index> bins_of(const std::vector<double>& values) {
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  std::vector<double> edges;
  for (Eigen::Index k = 1; k < kBins; ++k) {
    edges.push_back(sorted[sorted.size() * static_cast<std::size_t>(k) / kBins]);
  }
  std::vector<Eigen::Index> bins;
  for (const double value : values) {
    bins.push_back(std::upper_bound(edges.begin(), edges.end(), value) - edges.begin());
  }
  return bins;
}

// Three ones a sample: position, velocity, direction.
struct StepColumns {
  static constexpr Eigen::Index kSize = 2 * kBins + 2;
  std::vector<Eigen::Index> position, velocity;
  std::vector<bool> forward;

  [[nodiscard]] std::array<Eigen::Index, 3> ones(std::size_t sample) const {
    return {position[sample], kBins + velocity[sample], 2 * kBins + (forward[sample] ? 1 : 0)};
  }
};

// Steps at the samples that count.
StepColumns step_columns(const ForceBalanceRows& rows, Eigen::Index joint) {
  std::vector<double> position, velocity;
  Eigen::Index row = 0;
  for (const Motion& piece : rows.pieces) {
    for (Eigen::Index t = 0; t < piece.samples(); ++t, ++row) {
      if (rows.counts.size() > 0 && rows.counts(row, joint) == 0.0) continue;
      position.push_back(piece.position(t, joint));
      velocity.push_back(piece.velocity(t, joint));
    }
  }
  StepColumns columns{bins_of(position), bins_of(velocity), {}};
  for (const double value : velocity) columns.forward.push_back(value > 0.0);
  return columns;
}

struct Normal {
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(StepColumns::kSize, StepColumns::kSize);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(StepColumns::kSize);

  void add(const std::array<Eigen::Index, 3>& ones, double value) {
    for (const Eigen::Index a : ones) {
      right(a) += value;
      for (const Eigen::Index b : ones) products(a, b) += 1.0;
    }
  }
};

// What is left of one joint's residuals when each fold is predicted by the others.
Eigen::VectorXd prediction_errors(const StepColumns& columns, const Eigen::VectorXd& values) {
  const Eigen::Index n = values.size();
  std::array<Normal, kFolds> folds;
  for (Eigen::Index t = 0; t < n; ++t) {
    folds[static_cast<std::size_t>(fold_of(t, n))].add(columns.ones(static_cast<std::size_t>(t)),
                                                       values(t));
  }
  std::array<Eigen::VectorXd, kFolds> solutions;
  for (std::size_t out = 0; out < kFolds; ++out) {
    Normal rest;
    for (std::size_t fold = 0; fold < kFolds; ++fold) {
      if (fold == out) continue;
      rest.products += folds[fold].products;
      rest.right += folds[fold].right;
    }
    // Worth ten samples a step: bins hardly visited say nothing.
    rest.products.diagonal().array() += 10.0;
    solutions[out] = rest.products.llt().solve(rest.right);
  }
  Eigen::VectorXd errors = values;
  for (Eigen::Index t = 0; t < n; ++t) {
    const Eigen::VectorXd& solution = solutions[static_cast<std::size_t>(fold_of(t, n))];
    for (const Eigen::Index one : columns.ones(static_cast<std::size_t>(t))) {
      errors(t) -= solution(one);
    }
  }
  return errors;
}

}  // namespace

Eigen::MatrixXd unpredicted(const ForceBalanceRows& rows, const Eigen::MatrixXd& residuals) {
  Eigen::MatrixXd rest = residuals;
  for (Eigen::Index joint = 0; joint < rest.cols(); ++joint) {
    std::vector<Eigen::Index> counting;
    for (Eigen::Index t = 0; t < rest.rows(); ++t) {
      if (rows.counts.size() == 0 || rows.counts(t, joint) > 0.0) counting.push_back(t);
    }
    if (counting.empty()) continue;
    const Eigen::VectorXd own = residuals.col(joint)(counting);
    const Eigen::VectorXd errors = prediction_errors(step_columns(rows, joint), own);
    for (std::size_t k = 0; k < counting.size(); ++k) {
      rest(counting[k], joint) = errors(static_cast<Eigen::Index>(k));
    }
  }
  return rest;
}

double remaining_structure(const ForceBalanceRows& rows, const Eigen::MatrixXd& residuals) {
  const Eigen::MatrixXd rest = unpredicted(rows, residuals);
  double before = 0.0, after = 0.0;
  for (Eigen::Index joint = 0; joint < rest.cols(); ++joint) {
    const double square = residuals.col(joint).squaredNorm();
    if (!(square > 0.0)) continue;
    // Each joint counts alike, whatever its unit.
    before += 1.0;
    after += rest.col(joint).squaredNorm() / square;
  }
  return before > 0.0 ? std::max(0.0, 1.0 - after / before) : 0.0;
}

}  // namespace graybox
