#include "diagnosis/force_balance/balance_scores.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>
#include <vector>

#include "diagnosis/force_balance/balance_uncertainty.hpp"
#include "diagnosis/hypotheses/score_test.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

// What every hypothesis is asked: rows are samples over `rms`, coordinate after coordinate.
struct ScoreQuestion {
  const BalanceFitter& fitter;
  Eigen::VectorXd inverse_gains;
  const ScoreTest& test;
  const Eigen::MatrixXd& basis;  // of all that the fit has
  const Eigen::MatrixXd& right;  // what it leaves, and draws of noise
  const Eigen::VectorXd& rms;    // by coordinate
  double worth;                  // of a sample, in independent ones
  double square;                 // of what is left
};

// Products of columns over the noise with one another, with what the fit has and with what it
// leaves.
CandidateProducts products_with(const BalanceColumns& columns, const ScoreQuestion& question) {
  const Index samples = question.fitter.data().estimation.samples();
  CandidateProducts products{Eigen::MatrixXd::Zero(columns.count, columns.count),
                             Eigen::MatrixXd::Zero(columns.count, question.basis.cols()),
                             Eigen::MatrixXd::Zero(columns.count, question.right.cols())};
  for (Index j = 0; j < question.rms.size(); ++j) {
    const Eigen::MatrixXd& block = columns.in[static_cast<std::size_t>(j)];
    if (block.size() == 0) continue;
    const Eigen::MatrixXd own = block / question.rms(j);
    products.information.noalias() += own.transpose() * own;
    products.nuisance.noalias() +=
        own.transpose() * question.basis.middleRows(j * samples, samples);
    products.scores.noalias() += own.transpose() * question.right.middleRows(j * samples, samples);
  }
  return products;
}

// The best of the law's shapes.
HypothesisScore score_of(std::size_t hypothesis, const ScoreQuestion& question,
                         std::span<double> null_minima) {
  HypothesisScore best;
  best.start.hypothesis = hypothesis;
  const ForceBalanceData& data = question.fitter.data();
  const BalanceHypotheses& hypotheses = question.fitter.hypotheses();
  const CandidatePlace& place = hypotheses.place(hypothesis);
  const LawEntry& entry = hypotheses.entry(hypothesis);
  best.amplitude_unit = unit_at(entry.parameters.front().unit, place.location.units);
  best.shapes = 0;
  const PlacedLaw law = hypotheses.placed(hypothesis, {}, question.inverse_gains);
  std::vector<LawShape> shapes = law_shapes(entry, place, hypotheses.scale(hypothesis));
  // Where gains are known the mass alone shows, and its place follows in the refit.
  if (place.location.is_flange && law.inverse_gains.size() == 0) shapes.resize(1);
  for (const LawShape& shape : shapes) {
    if (shape.basis.empty()) continue;
    const CandidateProducts products =
        products_with(basis_columns(law, shape.basis, data, data.estimation), question);
    if (!products.information.allFinite() || !(products.information.trace() > 0.0)) continue;
    ++best.shapes;
    question.test.lower_minimum_p_values(
        products, [&](const Eigen::VectorXd& amplitudes) { return shape.allows(amplitudes); },
        null_minima);
    CandidateScore score = question.test.score(products);
    if (score.statistic <= best.score.statistic) continue;
    std::vector<double> parameters = shape.parameters(score.amplitudes);
    if (parameters.empty() && !best.start.parameters.empty()) continue;
    best.amplitude = score.amplitudes(0);
    best.amplitude_deviation = std::sqrt(score.amplitude_covariance(0, 0) / question.worth);
    if (parameters.empty()) continue;  // the sign that it found is impossible
    best.start.parameters = std::move(parameters);
    best.explained_share = score.statistic / question.square;
    best.score = std::move(score);
  }
  return best;
}

// What the fit leaves, over `rms`, and so many draws of noise. Draws follow each other in time as
// the noise does. They are judged as the data are: a sample is worth `worth` of an independent one.
Eigen::MatrixXd rest_and_draws(const BalanceFitter& fitter, const Eigen::MatrixXd& rest,
                               const Eigen::VectorXd& rms, double worth, int null_draws,
                               std::uint64_t seed) {
  const ForceBalanceData& data = fitter.data();
  const ForceBalanceRows& rows = data.estimation;
  const Index samples = rest.rows();
  Eigen::MatrixXd right(rest.size(), 1 + null_draws);
  right.col(0) = (rest * rms.cwiseInverse().asDiagonal()).reshaped();
  Random random(seed);
  for (Index b = 1; b <= null_draws; ++b) {
    for (Index j = 0; j < rows.coordinates(); ++j) {
      const auto at = static_cast<std::size_t>(j);
      Eigen::VectorXd draw = fitter.noises()[at].draw(random);
      if (rows.counts.size() > 0) draw.array() *= rows.counts.col(j).array();
      const double scale = std::sqrt(worth * rows.counted(j) / draw.squaredNorm());
      right.col(b).segment(j * samples, samples) = data.idle[at] || !std::isfinite(scale)
                                                       ? Eigen::VectorXd::Zero(samples)
                                                       : Eigen::VectorXd(scale * draw);
    }
  }
  return right;
}

// Columns of all that the fit has, with the rows of the prior, which `right` gets, too.
Eigen::MatrixXd columns_of(const BalanceFitter& fitter, const ExtendedFit& fit,
                           const Eigen::VectorXd& rms, Eigen::MatrixXd& right) {
  const ForceBalanceRows& rows = fitter.data().estimation;
  std::vector<PlacedLaw> present;
  for (const FittedLaw& law : fit.laws) present.push_back(fitter.placed_of(fit, law));
  std::vector<LawColumn> unused;
  Eigen::MatrixXd columns = information_columns(fitter.data(), present, rms, unused);
  append_prior_rows(rows, columns);
  const Index of_data = right.rows(), of_prior = columns.rows() - of_data;
  right.conservativeResize(columns.rows(), Eigen::NoChange);
  right.bottomRows(of_prior).setZero();
  const Eigen::VectorXd precision = prior_precision(rows, columns.cols());
  for (Index k = 0; k < of_prior; ++k) {
    const double value = fit.model_parameters[static_cast<std::size_t>(k)].value;
    right(of_data + k, 0) = -std::sqrt(precision(k)) * value;
  }
  return columns;
}

// Samples that count in coordinates which move.
double counted_samples(const ForceBalanceData& data) {
  double counted = 0.0;
  for (Index j = 0; j < data.estimation.coordinates(); ++j) {
    if (!data.idle[static_cast<std::size_t>(j)]) counted += data.estimation.counted(j);
  }
  return counted;
}

// The least p-value of each draw over all hypotheses.
std::vector<double> least_of_each(const std::vector<std::vector<double>>& minima, int null_draws) {
  std::vector<double> least(static_cast<std::size_t>(null_draws), 1.0);
  for (const std::vector<double>& own : minima) {
    for (std::size_t b = 0; b < own.size(); ++b) least[b] = std::min(least[b], own[b]);
  }
  return least;
}

}  // namespace

ScoreTable balance_scores(const BalanceFitter& fitter, const ExtendedFit& fit,
                          std::span<const std::size_t> asked, int null_draws, std::uint64_t seed,
                          int threads) {
  const ForceBalanceRows& rows = fitter.data().estimation;
  const Eigen::MatrixXd rest = fitter.residuals(fit, rows);
  const Eigen::VectorXd rms = rms_of(rows, rest);
  const double worth = fitter.sample_count() / std::max(1.0, counted_samples(fitter.data()));
  Eigen::MatrixXd right = rest_and_draws(fitter, rest, rms, worth, null_draws, seed);
  const Eigen::MatrixXd columns = columns_of(fitter, fit, rms, right);
  Eigen::MatrixXd basis(columns.rows(), 0);
  (void)extend_basis(columns, basis);
  const double square = right.col(0).squaredNorm(), count = fitter.sample_count();
  const double freedom = std::max(count - static_cast<double>(basis.cols()), 0.5 * count);
  const ScoreTest test(
      {Eigen::MatrixXd::Identity(basis.cols(), basis.cols()), basis.transpose() * right},
      {square, freedom});
  const ScoreQuestion question{fitter, fitter.inverse_gains(fit), test, basis, right, rms, worth,
                               square};
  ScoreTable table;
  table.scores.resize(asked.size());
  std::vector<std::vector<double>> minima(
      asked.size(), std::vector<double>(static_cast<std::size_t>(null_draws), 1.0));
  std::exception_ptr failure;
#pragma omp parallel for num_threads(threads) schedule(dynamic)
  for (std::size_t i = 0; i < asked.size(); ++i) {
    try {
      table.scores[i] = score_of(asked[i], question, minima[i]);
    } catch (...) {  // must not leave a thread
#pragma omp critical(force_balance_scores)
      failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
  table.null_minima = least_of_each(minima, null_draws);
  return table;
}

}  // namespace graybox
