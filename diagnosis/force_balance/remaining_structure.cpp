#include "diagnosis/force_balance/remaining_structure.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <string>
#include <vector>

namespace graybox {
namespace {

constexpr Eigen::Index kBins = 16;
constexpr Eigen::Index kFolds = 5;
constexpr double kClearly = 0.9;  // of the squares that steps leave

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

// Samples of one load that count, and how a joint moves there.
struct CountingSamples {
  std::vector<Eigen::Index> rows;
  std::vector<double> position, velocity;
};

// Those of each load: what depends on the motion with one load and against it with another would
// add up to nothing.
std::map<std::string, CountingSamples> counting_samples(const ForceBalanceRows& rows,
                                                        Eigen::Index joint) {
  std::map<std::string, CountingSamples> by_load;
  Eigen::Index row = 0;
  for (const Motion& piece : rows.pieces) {
    CountingSamples& samples = by_load[piece.load];
    for (Eigen::Index t = 0; t < piece.samples(); ++t, ++row) {
      if (rows.counts.size() > 0 && rows.counts(row, joint) == 0.0) continue;
      samples.rows.push_back(row);
      samples.position.push_back(piece.position(t, joint));
      samples.velocity.push_back(piece.velocity(t, joint));
    }
  }
  return by_load;
}

StepColumns step_columns(const std::vector<double>& position, const std::vector<double>& velocity) {
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

// What is left when a constant, the velocity and its sign predict each fold by the others: few
// samples tell these and not thirty steps.
Eigen::VectorXd friction_errors(const std::vector<double>& velocity,
                                const Eigen::VectorXd& values) {
  const Eigen::Index n = values.size();
  const auto v = Eigen::Map<const Eigen::VectorXd>(velocity.data(), n);
  Eigen::MatrixX3d columns(n, 3);
  columns << Eigen::VectorXd::Ones(n), v / std::max(v.cwiseAbs().maxCoeff(), 1e-300),
      v.array().sign().matrix();
  std::array<Eigen::Matrix3d, kFolds> products;
  std::array<Eigen::Vector3d, kFolds> right;
  products.fill(Eigen::Matrix3d::Zero());
  right.fill(Eigen::Vector3d::Zero());
  for (Eigen::Index t = 0; t < n; ++t) {
    const auto fold = static_cast<std::size_t>(fold_of(t, n));
    products[fold] += columns.row(t).transpose() * columns.row(t);
    right[fold] += columns.row(t).transpose() * values(t);
  }
  const Eigen::Matrix3d ridge = Eigen::Matrix3d::Identity();  // worth a sample
  const Eigen::Matrix3d all =
      std::accumulate(products.begin(), products.end(), Eigen::Matrix3d(ridge));
  const Eigen::Vector3d sum =
      std::accumulate(right.begin(), right.end(), Eigen::Vector3d(Eigen::Vector3d::Zero()));
  Eigen::VectorXd errors = values;
  for (Eigen::Index t = 0; t < n; ++t) {
    const auto fold = static_cast<std::size_t>(fold_of(t, n));
    const Eigen::Matrix3d others = all - products[fold];
    errors(t) -= columns.row(t).dot(others.ldlt().solve(sum - right[fold]));
  }
  return errors;
}

}  // namespace

Eigen::MatrixXd unpredicted(const ForceBalanceRows& rows, const Eigen::MatrixXd& residuals) {
  Eigen::MatrixXd rest = residuals;
  for (Eigen::Index joint = 0; joint < rest.cols(); ++joint) {
    for (const auto& [load, samples] : counting_samples(rows, joint)) {
      if (samples.rows.empty()) continue;
      const Eigen::VectorXd own = residuals.col(joint)(samples.rows);
      const Eigen::VectorXd by_steps =
          prediction_errors(step_columns(samples.position, samples.velocity), own);
      const Eigen::VectorXd by_friction = friction_errors(samples.velocity, own);
      const bool is_friction = by_friction.squaredNorm() < kClearly * by_steps.squaredNorm();
      rest.col(joint)(samples.rows) = is_friction ? by_friction : by_steps;
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
