#include "diagnosis/force_balance/balance_regression.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr int kMaxIterations = 50;
constexpr int kTrialIterations = 6;       // of each start
constexpr double kLeastNoise = 1e-4;      // of that of the model alone, to weigh by
constexpr double kLeftOut = 100.0;        // times its noise: a coordinate all but left out
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

// Root mean squares by coordinate; of one that carries nothing the largest of all.
Eigen::VectorXd noise_scale(const ForceBalanceRows& rows, const Eigen::MatrixXd& force) {
  const Eigen::VectorXd rms = rows.root_mean_squares(force);
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

// The normal equations of one fit: [Q, L], in units of noise().
struct BalanceRegression::System {
  struct Equations {
    Eigen::MatrixXd matrix;
    Eigen::VectorXd right;
    double force = 0.0;

    [[nodiscard]] double square(const Eigen::VectorXd& x) const {
      return std::max(0.0, force - 2.0 * x.dot(right) + x.dot(matrix * x));
    }
    void operator+=(const Equations& other) {
      matrix += other.matrix;
      right += other.right;
      force += other.force;
    }
  };
  std::vector<Equations> parts;   // by block and coordinate, index()
  std::vector<Equations> totals;  // by coordinate
  Eigen::VectorXd length;         // of the laws' columns, which are divided by it
  Eigen::MatrixXd prior;          // G^T G

  // Least squares of all blocks, or of all but one, of which `left_out` has the parts.
  [[nodiscard]] LinearSolution solution(const Eigen::VectorXd& relative_noise,
                                        std::span<const Equations> left_out = {}) const {
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(totals[0].right.size(), totals[0].right.size());
    Eigen::VectorXd right = Eigen::VectorXd::Zero(totals[0].right.size());
    for (std::size_t j = 0; j < totals.size(); ++j) {
      const double deviation = relative_noise(static_cast<Index>(j));
      const double weight = 1.0 / (deviation * deviation);
      matrix += weight * totals[j].matrix;
      right += weight * totals[j].right;
      if (left_out.empty()) continue;
      matrix -= weight * left_out[j].matrix;
      right -= weight * left_out[j].right;
    }
    matrix.topLeftCorner(prior.rows(), prior.cols()) += prior;
    return solve(matrix, right);
  }
};

// A noise and what fits best under it.
struct BalanceRegression::Settled {
  Eigen::VectorXd relative_noise;
  LinearSolution solution;

  [[nodiscard]] double deviance() const { return relative_noise.array().log().sum(); }
};

Eigen::VectorXd rms_of(const ForceBalanceRows& rows, const Eigen::MatrixXd& residuals) {
  const Eigen::VectorXd rms = rows.root_mean_squares(residuals);
  return rms.cwiseMax(1e-12 * std::max(rms.maxCoeff(), 1e-300));
}

double centred_square(const Eigen::MatrixXd& values) {
  constexpr double kNeverChanges = 1e-18;  // of its square
  double sum = 0.0;
  for (const auto& column : values.colwise()) {
    const double square = column.squaredNorm();
    const double about_mean = (column.array() - column.mean()).square().sum();
    sum += about_mean > kNeverChanges * square ? about_mean : square;
  }
  return sum;
}

void append_columns(const Eigen::MatrixXd& more, Eigen::MatrixXd& columns) {
  const Index first = columns.cols();
  columns.conservativeResize(more.rows(), first + more.cols());
  columns.rightCols(more.cols()) = more;
}

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
  const Eigen::VectorXd rms = noise_scale(rows, rows.force);
  noise_ = rms;
  // The noise of the model alone first: projected() weighs coordinates by it.
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Eigen::MatrixXd q = basis(noise_).topRows(rows.force.size());
    const Eigen::VectorXd force = stacked(rows.force, noise_);
    const Eigen::VectorXd rest = force - q * (q.transpose() * force);
    const Eigen::VectorXd next =
        (noise_scale(rows, rest.reshaped(rows.samples(), coordinates())).array() * noise_.array())
            .max(kNoiseFloor * rms.array());
    const double change = ((next - noise_).array() / next.array()).abs().maxCoeff();
    noise_ = next;
    if (change < kNoiseTolerance || rows.model.count == 0) break;
  }
  compress();
}

BalanceRegression::BalanceRegression(const ForceBalanceRows& rows, Eigen::VectorXd noise)
    : rows_(rows), noise_(std::move(noise)) {
  cut_into_blocks();
  compress();
}

void BalanceRegression::compress() {
  const Eigen::MatrixXd both = basis(noise_);
  const Index rows = rows_.force.size();
  basis_ = both.topRows(rows);
  prior_ = both.bottomRows(both.rows() - rows);
  triangle_ = basis_.transpose() * scaled_model(rows_, noise_) + prior_.transpose() * prior_rows();
  scaled_force_ = stacked(rows_.force, noise_);
  const Index p = basis_.cols();
  for (Index b = 0; b < kBlocks; ++b) {
    for (Index j = 0; j < coordinates(); ++j) {
      Products& sums = products_.emplace_back(
          Products{Eigen::MatrixXd::Zero(p, p), Eigen::VectorXd::Zero(p), 0.0});
      for (const Rows& part : blocks_[index(b, j)]) {
        const auto q = basis_.middleRows(j * rows_.samples() + part.first, part.count);
        const auto y = scaled_force_.segment(j * rows_.samples() + part.first, part.count);
        sums.basis.noalias() += q.transpose() * q;
        sums.basis_force.noalias() += q.transpose() * y;
        sums.force += y.squaredNorm();
      }
    }
  }
}

void BalanceRegression::cut_into_blocks() {
  blocks_.resize(static_cast<std::size_t>(kBlocks * coordinates()));
  for (Index j = 0; j < coordinates(); ++j) cut_into_blocks(j);
}

// Pieces of one load that follow each other are cut into tenths together.
void BalanceRegression::cut_into_blocks(Index coordinate) {
  Index first = 0;
  for (std::size_t piece = 0; piece < rows_.pieces.size();) {
    const std::string& load = rows_.pieces[piece].load;
    Index rows = 0;
    for (; piece < rows_.pieces.size() && rows_.pieces[piece].load == load; ++piece) {
      rows += rows_.pieces[piece].samples();
    }
    const double all = rows_.counted(coordinate, first, rows);
    Index begin = 0;
    double before = 0.0;
    for (Index b = 0; b < kBlocks; ++b) {
      Index end = all > 0.0 ? begin : (b + 1) * rows / kBlocks;
      const double share = all * static_cast<double>(b + 1) / static_cast<double>(kBlocks);
      while (all > 0.0 && end < rows && (before < share || b + 1 == kBlocks)) {
        before += rows_.counted(coordinate, first + end, 1);
        ++end;
      }
      blocks_[index(b, coordinate)].push_back({first + begin, end - begin});
      begin = end;
    }
    first += rows;
  }
}

double BalanceRegression::counted(Index block, Index coordinate) const {
  double count = 0.0;
  for (const Rows& part : blocks_[index(block, coordinate)]) {
    count += rows_.counted(coordinate, part.first, part.count);
  }
  return count;
}

Eigen::MatrixXd BalanceRegression::basis(const Eigen::VectorXd& noise) const {
  const Eigen::MatrixXd model = scaled_model(rows_, noise), prior = prior_rows();
  Eigen::MatrixXd columns(model.rows() + prior.rows(), model.cols());
  if (columns.cols() == 0) return columns;
  columns << model, prior;
  for (Index k = 0; k < columns.cols(); ++k) columns.col(k).normalize();
  const Eigen::HouseholderQR<Eigen::MatrixXd> factor(columns);
  return factor.householderQ() * Eigen::MatrixXd::Identity(columns.rows(), columns.cols());
}

Eigen::MatrixXd BalanceRegression::prior_rows() const {
  const Eigen::VectorXd& precision = rows_.model_precision;
  const Index count = rows_.model.count;
  if (precision.size() == 0) return Eigen::MatrixXd::Zero(0, count);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero((precision.array() > 0.0).count(), count);
  Index row = 0;
  for (Index k = 0; k < count; ++k) {
    if (precision(k) > 0.0) rows(row++, k) = std::sqrt(precision(k));
  }
  return rows;
}

BalanceRegression::System BalanceRegression::system(std::span<const BalanceColumns> laws) const {
  using Equations = System::Equations;
  const Index p = basis_.cols();
  Index m = 0;
  for (const BalanceColumns& law : laws) m += law.count;
  System result;
  result.parts.resize(static_cast<std::size_t>(kBlocks * coordinates()));
  result.length = Eigen::VectorXd::Zero(m);
  result.prior = prior_.transpose() * prior_;
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
      Equations& part = result.parts[index(b, j)];
      part = {Eigen::MatrixXd::Zero(p + m, p + m), Eigen::VectorXd::Zero(p + m), fixed.force};
      part.matrix.topLeftCorner(p, p) = fixed.basis;
      part.right.head(p) = fixed.basis_force;
      for (const Rows& rows : blocks_[index(b, j)]) {
        const auto own = columns.middleRows(rows.first, rows.count);
        const Index first = j * samples + rows.first;
        part.matrix.bottomLeftCorner(m, p).noalias() +=
            own.transpose() * basis_.middleRows(first, rows.count);
        part.matrix.bottomRightCorner(m, m).noalias() += own.transpose() * own;
        part.right.tail(m).noalias() += own.transpose() * scaled_force_.segment(first, rows.count);
      }
      if (p > 0 && m > 0) {  // Eigen takes empty blocks for one another
        part.matrix.topRightCorner(p, m) = part.matrix.bottomLeftCorner(m, p).transpose();
      }
    }
  }
  result.length = result.length.cwiseSqrt();
  Eigen::VectorXd unit = Eigen::VectorXd::Ones(p + m);
  unit.tail(m) = result.length.cwiseInverse();
  for (Equations& part : result.parts) {
    part.matrix = unit.asDiagonal() * part.matrix * unit.asDiagonal();
    part.right.array() *= unit.array();
  }
  for (Index j = 0; j < coordinates(); ++j) {
    Equations& total = result.totals.emplace_back(result.parts[index(0, j)]);
    for (Index b = 1; b < kBlocks; ++b) total += result.parts[index(b, j)];
  }
  return result;
}

// Iterations from the noise of `state`; ends without full rank where a fit has none.
void BalanceRegression::settle(const System& system, int iterations, Settled& state) const {
  const Index joints = coordinates();
  const double share =
      static_cast<double>(system.totals[0].right.size()) / static_cast<double>(joints);
  const Eigen::VectorXd floor = kNoiseFloor * noise_scale(rows_, rows_.force).cwiseQuotient(noise_);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    state.solution = system.solution(state.relative_noise);
    if (!state.solution.full_rank) return;
    Eigen::VectorXd next(joints);
    for (Index j = 0; j < joints; ++j) {
      const double square =
          system.totals[static_cast<std::size_t>(j)].square(state.solution.values);
      next(j) = std::max(std::sqrt(square / std::max(1.0, rows_.counted(j) - share)), floor(j));
    }
    const double change = ((next - state.relative_noise).array() / next.array()).abs().maxCoeff();
    state.relative_noise = next;
    const bool is_weighed = joints > 1 || prior_.rows() > 0;
    if (change < kNoiseTolerance || !is_weighed) return;
  }
}

// The most likely noise that the starts lead to.
BalanceRegression::Settled BalanceRegression::settled(const System& system) const {
  const Index joints = coordinates();
  Settled best{Eigen::VectorXd::Ones(joints), {}};
  if (joints > 1) {
    settle(system, kTrialIterations, best);
    for (Index j = 0; best.solution.full_rank && j < joints; ++j) {
      Settled trial{Eigen::VectorXd::Ones(joints), {}};
      trial.relative_noise(j) = kLeftOut;
      settle(system, kTrialIterations, trial);
      if (trial.solution.full_rank && trial.deviance() < best.deviance()) best = trial;
    }
  }
  settle(system, kMaxIterations, best);
  return best;
}

BalanceFit BalanceRegression::fit(std::span<const BalanceColumns> laws) const {
  const System own = system(laws);
  const Index p = basis_.cols(), m = own.length.size();
  BalanceFit fit;
  if (m > 0 && !(own.length.minCoeff() > 0.0)) return fit;
  const Settled state = settled(own);
  if (!state.solution.full_rank) return fit;
  const Eigen::VectorXd& found = state.solution.values;
  fit.full_rank = true;
  fit.noise = state.relative_noise.cwiseProduct(noise_);
  fit.amplitudes = found.tail(m).cwiseQuotient(own.length);
  fit.model = found.head(p);
  if (p > 0) fit.model = triangle_.triangularView<Eigen::Upper>().solve(found.head(p));
  fit.residuals = residuals(laws, fit);
  fit.held_out = predicted_by_others(own, state);
  return fit;
}

Eigen::MatrixXd BalanceRegression::residuals(std::span<const BalanceColumns> laws,
                                             const BalanceFit& fit) const {
  Eigen::MatrixXd result = rows_.force;
  for (Index j = 0; j < coordinates(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    if (fit.model.size() > 0) result.col(j) -= rows_.model.in[at] * fit.model;
    Index first = 0;
    for (const BalanceColumns& law : laws) {
      const Eigen::MatrixXd& columns = law.in[at];
      if (columns.size() > 0) {
        result.col(j) -= columns * fit.amplitudes.segment(first, law.count);
      }
      first += law.count;
    }
  }
  return result;
}

// Mean squared errors: blocks x coordinates.
Eigen::MatrixXd BalanceRegression::predicted_by_others(const System& system,
                                                       const Settled& state) const {
  Eigen::MatrixXd result(kBlocks, coordinates());
  for (Index b = 0; b < kBlocks; ++b) {
    const auto of_block =
        std::span(system.parts).subspan(index(b, 0), static_cast<std::size_t>(coordinates()));
    const LinearSolution others = system.solution(state.relative_noise, of_block);
    for (Index j = 0; j < coordinates(); ++j) {
      const double count = counted(b, j);
      if (count == 0.0) {  // nothing to predict
        result(b, j) = 1.0;
        continue;
      }
      result(b, j) = others.full_rank
                         ? of_block[static_cast<std::size_t>(j)].square(others.values) * noise_(j) *
                               noise_(j) / count
                         : std::numeric_limits<double>::infinity();
    }
  }
  return result;
}

BalanceProjection::BalanceProjection(const BalanceRegression& regression,
                                     const Eigen::VectorXd& noise)
    : regression_(regression),
      noise_(noise.cwiseMax(kLeastNoise * regression.noise_)),
      weights_(regression.noise_.cwiseQuotient(noise_)) {
  const ForceBalanceRows& rows = regression.rows_;
  Eigen::MatrixXd normal = regression.prior_.transpose() * regression.prior_;
  BalanceColumns force;
  force.count = 1;
  for (Index j = 0; j < rows.coordinates(); ++j) {
    for (Index b = 0; b < BalanceRegression::kBlocks; ++b) {
      normal += weights_(j) * weights_(j) * regression.products_[regression.index(b, j)].basis;
    }
    force.in.emplace_back(rows.force.col(j));
  }
  normal_.compute(normal);
  force_ = columns(force).col(0);
}

Eigen::MatrixXd BalanceProjection::columns(const BalanceColumns& columns) const {
  const Index samples = regression_.rows_.samples(), joints = regression_.coordinates();
  const Eigen::MatrixXd& basis = regression_.basis_;
  const Eigen::MatrixXd& prior = regression_.prior_;
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(samples * joints + prior.rows(), columns.count);
  Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(basis.cols(), columns.count);
  for (Index j = 0; j < joints; ++j) {
    const Eigen::MatrixXd& own = columns.in[static_cast<std::size_t>(j)];
    if (own.size() == 0) continue;
    auto block = result.middleRows(j * samples, samples);
    block = own / noise_(j);
    shares.noalias() += weights_(j) * basis.middleRows(j * samples, samples).transpose() * block;
  }
  if (basis.cols() == 0) return result;
  shares = normal_.solve(shares).eval();
  for (Index j = 0; j < joints; ++j) {
    result.middleRows(j * samples, samples).noalias() -=
        weights_(j) * basis.middleRows(j * samples, samples) * shares;
  }
  result.bottomRows(prior.rows()).noalias() = -prior * shares;
  return result;
}

}  // namespace graybox
