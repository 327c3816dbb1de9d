#include "graybox/diagnosis/force_balance/balance_regression.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr int kMaxIterations = 50;
constexpr double kNoiseTolerance = 1e-6;  // relative change
constexpr double kNoiseFloor = 1e-7;      // of the force's root mean square
// What must be left of a column's square beside the others.
constexpr double kIndependent = 1e-10;
constexpr double kIndependentLength = 1e-5;

// Rows of the model's columns over the noise.
Eigen::MatrixXd scaled_model(const ForceBalanceRows& rows, const Eigen::VectorXd& noise) {
  Eigen::MatrixXd result(rows.samples() * rows.coordinates(), rows.model.count);
  for (Index j = 0; j < rows.coordinates(); ++j) {
    result.middleRows(j * rows.samples(), rows.samples()) =
        rows.model.in[static_cast<std::size_t>(j)] / noise(j);
  }
  return result;
}

Eigen::VectorXd stacked(const Eigen::MatrixXd& samples, const Eigen::VectorXd& noise) {
  const Eigen::MatrixXd scaled = samples * noise.cwiseInverse().asDiagonal();
  return scaled.reshaped();
}

Eigen::VectorXd rms_of(const Eigen::MatrixXd& force) {
  Eigen::VectorXd rms =
      (force.colwise().squaredNorm() / static_cast<double>(force.rows())).cwiseSqrt();
  const double largest = rms.maxCoeff();
  return (rms.array() > 0.0).select(rms, largest > 0.0 ? largest : 1.0);
}

struct LinearSolution {
  Eigen::VectorXd values;
  bool full_rank = false;
};

// Symmetric positive definite systems, scaled to a unit diagonal.
LinearSolution solve(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  if (right.size() == 0) return {right, true};
  const Eigen::VectorXd diagonal = matrix.diagonal();
  if (!(diagonal.minCoeff() > 0.0) || !matrix.allFinite()) return {};
  const Eigen::VectorXd unit = diagonal.cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> factor(unit.asDiagonal() * matrix * unit.asDiagonal());
  if (factor.info() != Eigen::Success) return {};
  const Eigen::MatrixXd triangle = factor.matrixL();
  if (triangle.diagonal().cwiseAbs2().minCoeff() < kIndependent) return {};
  return {unit.cwiseProduct(factor.solve(unit.cwiseProduct(right))), true};
}

}  // namespace

// The normal equations of one fit by block and coordinate: [Q, L].
struct BalanceRegression::System {
  std::vector<Eigen::MatrixXd> matrix;
  std::vector<Eigen::VectorXd> right;
  Eigen::VectorXd length;  // of the laws' columns, which are divided by it
};

std::vector<bool> extend_basis(const Eigen::MatrixXd& columns, Eigen::MatrixXd& basis) {
  std::vector<bool> is_new;
  for (Index k = 0; k < columns.cols(); ++k) {
    Eigen::VectorXd rest = columns.col(k);
    const double length = rest.norm();
    for (int pass = 0; pass < 2; ++pass) rest -= basis * (basis.transpose() * rest);
    is_new.push_back(std::isfinite(length) && rest.norm() > kIndependentLength * length);
    if (!is_new.back()) continue;
    basis.conservativeResize(rest.size(), basis.cols() + 1);
    basis.rightCols(1) = rest.normalized();
  }
  return is_new;
}

BalanceRegression::BalanceRegression(const ForceBalanceRows& rows) : rows_(rows) {
  cut_into_blocks();
  const Eigen::VectorXd rms = rms_of(rows.force);
  noise_ = rms;
  // The noise of the model alone first: projected() weighs coordinates by it.
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Eigen::MatrixXd q = basis(noise_);
    const Eigen::VectorXd force = stacked(rows.force, noise_);
    const Eigen::VectorXd rest = force - q * (q.transpose() * force);
    const Eigen::VectorXd next =
        (rms_of(rest.reshaped(rows.samples(), coordinates())).array() * noise_.array())
            .max(kNoiseFloor * rms.array());
    const double change = ((next - noise_).array() / next.array()).abs().maxCoeff();
    noise_ = next;
    if (change < kNoiseTolerance || rows.model.count == 0) break;
  }
  basis_ = basis(noise_);
  triangle_ = basis_.transpose() * scaled_model(rows, noise_);
  scaled_force_ = stacked(rows.force, noise_);
  projected_force_ = scaled_force_ - basis_ * (basis_.transpose() * scaled_force_);
  const Index p = basis_.cols();
  for (const std::vector<Rows>& block : blocks_) {
    for (Index j = 0; j < coordinates(); ++j) {
      Products& sums = products_.emplace_back(
          Products{Eigen::MatrixXd::Zero(p, p), Eigen::VectorXd::Zero(p), 0.0});
      for (const Rows& part : block) {
        const auto q = basis_.middleRows(j * rows.samples() + part.first, part.count);
        const auto y = scaled_force_.segment(j * rows.samples() + part.first, part.count);
        sums.basis.noalias() += q.transpose() * q;
        sums.basis_force.noalias() += q.transpose() * y;
        sums.force += y.squaredNorm();
      }
    }
  }
}

// Pieces of one load that follow each other are cut into tenths together.
void BalanceRegression::cut_into_blocks() {
  blocks_.resize(kBlocks);
  Index first = 0;
  for (std::size_t piece = 0; piece < rows_.pieces.size();) {
    const std::string& load = rows_.pieces[piece].load;
    Index count = 0;
    for (; piece < rows_.pieces.size() && rows_.pieces[piece].load == load; ++piece) {
      count += rows_.pieces[piece].samples();
    }
    for (Index b = 0; b < kBlocks; ++b) {
      const Index begin = b * count / kBlocks, end = (b + 1) * count / kBlocks;
      blocks_[static_cast<std::size_t>(b)].push_back({first + begin, end - begin});
    }
    first += count;
  }
}

Eigen::Index BalanceRegression::samples_of(Index block) const {
  Index count = 0;
  for (const Rows& part : blocks_[static_cast<std::size_t>(block)]) count += part.count;
  return count;
}

Eigen::MatrixXd BalanceRegression::basis(const Eigen::VectorXd& noise) const {
  Eigen::MatrixXd columns = scaled_model(rows_, noise);
  if (columns.cols() == 0) return columns;
  for (Index k = 0; k < columns.cols(); ++k) columns.col(k).normalize();
  const Eigen::HouseholderQR<Eigen::MatrixXd> factor(columns);
  return factor.householderQ() * Eigen::MatrixXd::Identity(columns.rows(), columns.cols());
}

Eigen::MatrixXd BalanceRegression::projected(const BalanceColumns& columns) const {
  const Index samples = rows_.samples();
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(samples * coordinates(), columns.count);
  Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(basis_.cols(), columns.count);
  for (Index j = 0; j < coordinates(); ++j) {
    const Eigen::MatrixXd& own = columns.in[static_cast<std::size_t>(j)];
    if (own.size() == 0) continue;
    auto block = result.middleRows(j * samples, samples);
    block = own / noise_(j);
    shares.noalias() += basis_.middleRows(j * samples, samples).transpose() * block;
  }
  result.noalias() -= basis_ * shares;
  return result;
}

BalanceRegression::System BalanceRegression::system(std::span<const BalanceColumns> laws) const {
  const Index p = basis_.cols();
  Index m = 0;
  for (const BalanceColumns& law : laws) m += law.count;
  System result;
  result.length = Eigen::VectorXd::Zero(m);
  const Index samples = rows_.samples();
  for (Index j = 0; j < coordinates(); ++j) {
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(samples, m);
    Index at = 0;
    for (const BalanceColumns& law : laws) {
      const Eigen::MatrixXd& own = law.in[static_cast<std::size_t>(j)];
      if (own.size() > 0) columns.middleCols(at, law.count) = own / noise_(j);
      at += law.count;
    }
    result.length += columns.colwise().squaredNorm().transpose();
    for (Index b = 0; b < kBlocks; ++b) {
      const Products& fixed = products_[index(b, j)];
      Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(p + m, p + m);
      Eigen::VectorXd right = Eigen::VectorXd::Zero(p + m);
      matrix.topLeftCorner(p, p) = fixed.basis;
      right.head(p) = fixed.basis_force;
      for (const Rows& part : blocks_[static_cast<std::size_t>(b)]) {
        const auto own = columns.middleRows(part.first, part.count);
        const Index first = j * samples + part.first;
        matrix.bottomLeftCorner(m, p).noalias() +=
            own.transpose() * basis_.middleRows(first, part.count);
        matrix.bottomRightCorner(m, m).noalias() += own.transpose() * own;
        right.tail(m).noalias() += own.transpose() * scaled_force_.segment(first, part.count);
      }
      matrix.topRightCorner(p, m) = matrix.bottomLeftCorner(m, p).transpose();
      result.matrix.push_back(std::move(matrix));
      result.right.push_back(std::move(right));
    }
  }
  result.length = result.length.cwiseSqrt();
  Eigen::VectorXd unit = Eigen::VectorXd::Ones(p + m);
  unit.tail(m) = result.length.cwiseInverse();
  for (Eigen::MatrixXd& matrix : result.matrix)
    matrix = unit.asDiagonal() * matrix * unit.asDiagonal();
  for (Eigen::VectorXd& right : result.right) right.array() *= unit.array();
  return result;
}

BalanceFit BalanceRegression::fit(std::span<const BalanceColumns> laws) const {
  const System own = system(laws);
  const Index p = basis_.cols(), m = own.length.size(), joints = coordinates();
  BalanceFit fit;
  if (m > 0 && !(own.length.minCoeff() > 0.0)) return fit;
  const auto at = [](Index b, Index j) { return static_cast<std::size_t>(j * kBlocks + b); };
  // In units of noise(): squared errors of all blocks but `left_out`, by coordinate.
  const auto square = [&](const Eigen::VectorXd& x, Index b, Index j) {
    const Eigen::VectorXd& right = own.right[at(b, j)];
    return std::max(
        0.0, products_[index(b, j)].force - 2.0 * x.dot(right) + x.dot(own.matrix[at(b, j)] * x));
  };
  const auto solution = [&](const Eigen::VectorXd& weights, Index left_out) {
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(p + m, p + m);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(p + m);
    for (Index j = 0; j < joints; ++j) {
      for (Index b = 0; b < kBlocks; ++b) {
        if (b == left_out) continue;
        matrix += weights(j) * own.matrix[at(b, j)];
        right += weights(j) * own.right[at(b, j)];
      }
    }
    return solve(matrix, right);
  };
  const double freedom = static_cast<double>(rows_.samples()) -
                         static_cast<double>(p + m) / static_cast<double>(joints);
  const Eigen::VectorXd floor = kNoiseFloor * rms_of(rows_.force).cwiseQuotient(noise_);
  Eigen::VectorXd relative = Eigen::VectorXd::Ones(joints);
  LinearSolution found;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    found = solution(relative.cwiseAbs2().cwiseInverse(), -1);
    if (!found.full_rank) return fit;
    Eigen::VectorXd next(joints);
    for (Index j = 0; j < joints; ++j) {
      double sum = 0.0;
      for (Index b = 0; b < kBlocks; ++b) sum += square(found.values, b, j);
      next(j) = std::max(std::sqrt(sum / freedom), floor(j));
    }
    const double change = ((next - relative).array() / next.array()).abs().maxCoeff();
    relative = next;
    if (change < kNoiseTolerance || joints == 1) break;
  }
  fit.full_rank = true;
  fit.noise = relative.cwiseProduct(noise_);
  fit.amplitudes = found.values.tail(m).cwiseQuotient(own.length);
  fit.model = found.values.head(p);
  if (p > 0) fit.model = triangle_.triangularView<Eigen::Upper>().solve(found.values.head(p));
  fit.residuals = rows_.force;
  for (Index j = 0; j < joints; ++j) {
    if (p > 0) fit.residuals.col(j) -= rows_.model.in[static_cast<std::size_t>(j)] * fit.model;
    Index first = 0;
    for (const BalanceColumns& law : laws) {
      const Eigen::MatrixXd& columns = law.in[static_cast<std::size_t>(j)];
      if (columns.size() > 0) {
        fit.residuals.col(j) -= columns * fit.amplitudes.segment(first, law.count);
      }
      first += law.count;
    }
  }
  fit.held_out.resize(kBlocks, joints);
  const Eigen::VectorXd weights = relative.cwiseAbs2().cwiseInverse();
  for (Index b = 0; b < kBlocks; ++b) {
    const LinearSolution others = solution(weights, b);
    const auto count = static_cast<double>(samples_of(b));
    for (Index j = 0; j < joints; ++j) {
      fit.held_out(b, j) = others.full_rank
                               ? square(others.values, b, j) * noise_(j) * noise_(j) / count
                               : std::numeric_limits<double>::infinity();
    }
  }
  return fit;
}

}  // namespace graybox
