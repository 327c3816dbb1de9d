#include "diagnosis/force_balance/balance_uncertainty.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/estimation/recording_spread.hpp"
#include "diagnosis/force_balance_data/payload_tangent.hpp"
#include "diagnosis/inverse_dynamics/weighted_regression.hpp"
#include "diagnosis/signals/long_run_variance.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Columns of several terms over `noise`: coordinate after coordinate.
Eigen::MatrixXd stacked(const BalanceColumns& columns, const Eigen::VectorXd& noise,
                        Index samples) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(samples * noise.size(), columns.count);
  for (Index j = 0; j < noise.size(); ++j) {
    const Eigen::MatrixXd& own = columns.in[static_cast<std::size_t>(j)];
    if (own.size() > 0) result.middleRows(j * samples, samples) = own / noise(j);
  }
  return result;
}

// What 1/gain of each joint's drive changes in the forces of payloads there: in the column of the
// gain, or one of its own at the end.
void add_gain_slopes(const ForceBalanceData& data, std::span<const PlacedLaw> laws,
                     const Eigen::VectorXd& noise, Eigen::MatrixXd& columns) {
  const Index samples = data.estimation.samples(), coordinates = data.estimation.coordinates();
  Eigen::MatrixXd carried = Eigen::MatrixXd::Zero(samples, coordinates);
  Eigen::VectorXd gains = Eigen::VectorXd::Zero(coordinates);
  for (const PlacedLaw& law : laws) {
    if (law.inverse_gains.size() == 0) continue;
    const BalanceColumns force = force_before_gains(law, data, data.estimation);
    gains = law.inverse_gains;
    for (Index j = 0; j < coordinates; ++j) {
      carried.col(j) += force.in[static_cast<std::size_t>(j)].col(0) / noise(j);
    }
  }
  for (Index j = 0; j < coordinates && carried.squaredNorm() > 0.0; ++j) {
    const Index gain = data.gain_parameters[static_cast<std::size_t>(j)];
    if (gain >= 0) {
      columns.col(gain).segment(j * samples, samples) += carried.col(j);
    } else if (gains(j) != 0.0) {
      append_columns(Eigen::MatrixXd::Zero(columns.rows(), 1), columns);
      columns.rightCols<1>().middleRows(j * samples, samples) = carried.col(j);
    }
  }
}

// What estimates by columns over the noise owe to the data and to the prior.
struct Influences {
  // Row t, column k is what the residuals at time t add to the error of parameter k: x_k - truth
  // is the sum over t.
  Eigen::MatrixXd of_data;
  // Row i, column k: what a standard deviation of the prior of parameter i does to that of k.
  Eigen::MatrixXd of_prior;
};

Influences influences(const ForceBalanceRows& rows, const Eigen::MatrixXd& columns,
                      const Eigen::VectorXd& precision, const BalanceFit& fitted) {
  const Eigen::VectorXd lengths = columns.colwise().norm();
  const Eigen::VectorXd unit = lengths.cwiseInverse();
  const Eigen::MatrixXd scaled = columns * unit.asDiagonal();
  Eigen::MatrixXd gram = scaled.transpose() * scaled;
  gram.diagonal() += precision.cwiseProduct(unit.cwiseAbs2());
  const Eigen::MatrixXd weighted =
      gram.ldlt().solve(Eigen::MatrixXd::Identity(gram.rows(), gram.cols())) * unit.asDiagonal();
  const Eigen::MatrixXd influence = scaled * weighted;
  const Index samples = rows.samples();
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(samples, columns.cols());
  for (Index j = 0; j < rows.coordinates(); ++j) {
    const Eigen::VectorXd rest = fitted.residuals.col(j) / fitted.noise(j);
    result += rest.asDiagonal() * influence.middleRows(j * samples, samples);
  }
  Eigen::MatrixXd of_prior(0, columns.cols());
  if (rows.model_precision.size() > 0) {
    // precision times deviation of the prior, which is 1 / sqrt(worth precision).
    const Eigen::VectorXd pull = (precision / rows.worth).cwiseSqrt();
    of_prior = pull.cwiseProduct(unit).asDiagonal() * weighted;
  }
  return {std::move(result), std::move(of_prior)};
}

// What each recording adds to the errors of the estimates, a row each.
Eigen::MatrixXd recording_sums(const ForceBalanceRows& rows, const Eigen::MatrixXd& influence) {
  Eigen::MatrixXd sums(0, influence.cols());
  Index row = 0;
  for (std::size_t piece = 0; piece < rows.pieces.size(); ++piece) {
    if (piece == 0 || rows.names[piece] != rows.names[piece - 1]) {
      sums.conservativeResize(sums.rows() + 1, Eigen::NoChange);
      sums.bottomRows<1>().setZero();
    }
    const Index samples = rows.pieces[piece].samples();
    sums.bottomRows<1>() += influence.middleRows(row, samples).colwise().sum();
    row += samples;
  }
  return sums;
}

}  // namespace

Eigen::MatrixXd covariance_of_sums(const ForceBalanceRows& rows, const Eigen::MatrixXd& scores,
                                   Eigen::Index fitted) {
  std::vector<Index> pieces;
  for (const Motion& piece : rows.pieces) pieces.push_back(piece.samples());
  const PrewhitenedScores whitened(scores, std::move(pieces));
  const Index lags = andrews_lags(whitened.whitened_correlations(), whitened.samples());
  const auto count = static_cast<double>(rows.force.size());
  return count / (count - static_cast<double>(fitted)) * whitened.long_run_variance(lags);
}

Eigen::MatrixXd information_columns(const ForceBalanceData& data, std::span<const PlacedLaw> laws,
                                    const Eigen::VectorXd& noise, std::vector<LawColumn>& of_laws) {
  const Index samples = data.estimation.samples();
  Eigen::MatrixXd columns = stacked(data.estimation.model, noise, samples);
  for (std::size_t l = 0; l < laws.size(); ++l) {
    const PlacedLaw& law = laws[l];
    const std::vector<std::size_t> linear = law.linear(), scaled = law.scaled();
    for (const std::size_t index : linear) of_laws.push_back({l, index});
    if (!linear.empty()) {
      append_columns(stacked(law_columns(law, data, data.estimation), noise, samples), columns);
    }
    std::vector<std::size_t> shaping = law.refined();
    if (!scaled.empty()) shaping.insert(shaping.begin(), scaled.front());
    if (shaping.empty()) continue;
    for (const std::size_t index : shaping) of_laws.push_back({l, index});
    append_columns(stacked(law_slopes(law, shaping, data, data.estimation), noise, samples),
                   columns);
  }
  add_gain_slopes(data, laws, noise, columns);
  return columns;
}

Eigen::VectorXd prior_precision(const ForceBalanceRows& rows, Index parameters) {
  Eigen::VectorXd precision = Eigen::VectorXd::Zero(parameters);
  const Eigen::VectorXd& model = rows.model_precision;
  precision.head(model.size()) = model;
  return precision;
}

void append_prior_rows(const ForceBalanceRows& rows, Eigen::MatrixXd& columns) {
  const Index first = columns.rows(), count = rows.model_precision.size();
  columns.conservativeResize(first + count, Eigen::NoChange);
  columns.bottomRows(count).setZero();
  const Eigen::VectorXd precision = prior_precision(rows, columns.cols());
  for (Index k = 0; k < count; ++k) columns(first + k, k) = std::sqrt(precision(k));
}

BalanceDeviations balance_deviations(const ForceBalanceData& data, std::span<const PlacedLaw> laws,
                                     const BalanceFit& fitted) {
  const ForceBalanceRows& rows = data.estimation;
  BalanceDeviations result;
  const Eigen::MatrixXd all = information_columns(data, laws, fitted.noise, result.parameters);
  Eigen::MatrixXd with_prior = all;
  append_prior_rows(rows, with_prior);
  Eigen::MatrixXd basis(with_prior.rows(), 0);
  const std::vector<bool> is_seen = extend_basis(with_prior, basis);
  std::vector<Index> seen;
  for (std::size_t k = 0; k < is_seen.size(); ++k) {
    if (is_seen[k]) seen.push_back(static_cast<Index>(k));
  }
  const Influences influence =
      influences(rows, all(Eigen::all, seen), prior_precision(rows, all.cols())(seen), fitted);
  const Eigen::VectorXd between = deviations_between(recording_sums(rows, influence.of_data));
  Eigen::VectorXd deviation = Eigen::VectorXd::Constant(all.cols(), kUnknown);
  for (std::size_t k = 0; k < seen.size(); ++k) {
    const auto own = static_cast<Index>(k);
    const double within =
        std::sqrt(covariance_of_sums(rows, influence.of_data.col(own), all.cols())(0, 0));
    const double of_data = std::max(within, between(own));
    deviation(seen[k]) = std::hypot(of_data, influence.of_prior.col(own).norm());
  }
  const Index model = rows.model.count;
  result.model = deviation.head(model);
  for (Index k = model; k < deviation.size(); ++k) result.of_parameters.push_back(deviation(k));
  return result;
}

std::vector<double> wald_statistics(const ForceBalanceData& data,
                                    std::span<const BalanceColumns> laws,
                                    const BalanceFit& fitted) {
  const ForceBalanceRows& rows = data.estimation;
  const Index samples = rows.samples();
  Eigen::MatrixXd columns = stacked(rows.model, fitted.noise, samples);
  const Index model = columns.cols();
  for (const BalanceColumns& law : laws)
    append_columns(stacked(law, fitted.noise, samples), columns);
  std::vector<double> result;
  if (laws.empty()) return result;
  const Influences influence =
      influences(rows, columns, prior_precision(rows, columns.cols()), fitted);
  Index first = 0;
  for (const BalanceColumns& law : laws) {
    const auto at = Eigen::seqN(model + first, law.count);
    const Eigen::MatrixXd of_prior = influence.of_prior(Eigen::all, at);
    const Eigen::MatrixXd own =
        covariance_of_sums(rows, influence.of_data(Eigen::all, at), columns.cols()) +
        of_prior.transpose() * of_prior;
    const Eigen::VectorXd amplitudes = fitted.amplitudes.segment(first, law.count);
    result.push_back(amplitudes.dot(own.completeOrthogonalDecomposition().solve(amplitudes)));
    first += law.count;
  }
  return result;
}

}  // namespace graybox
