#include "diagnosis/periodic/periodic_assessment.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <cmath>
#include <limits>

#include "diagnosis/harmonic_balance/noise_whitening.hpp"
#include "diagnosis/harmonic_balance/real_products.hpp"
#include "diagnosis/harmonic_balance/record_loop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

// Scaled so that the chi-square test holds although the noise is an estimate itself.
Assessment judged(const PeriodicData& data, const std::vector<MeasuredRecord>& records,
                  double chi_square, double degrees_of_freedom) {
  Assessment result;
  result.degrees_of_freedom = effective_degrees_of_freedom(data, records, degrees_of_freedom);
  result.chi_square = chi_square * result.degrees_of_freedom / degrees_of_freedom;
  return result;
}

// The steady states of recordings, and what they are worth.
class Prediction {
 public:
  Prediction(const PeriodicData& data, const ModelState& model,
             const std::vector<MeasuredRecord>& records)
      : model_(model), numbers_(data.numbers_in(records) / static_cast<double>(records.size())) {}

  // Sought from the recording, and on from where that led until it is found.
  const SteadyState& solve(SteadyStateSolver& solver, const MeasuredRecord& record) const {
    constexpr int kAttempts = 4;
    const SteadyState* state = &solver.solve(model_, record, nullptr);
    for (int attempt = 1; attempt < kAttempts && !is_found(*state); ++attempt) {
      const MatrixXcd reached = state->forces;
      state = &solver.solve(model_, record, &reached);
    }
    return *state;
  }

  // A state that was not found is in part the recording itself, and predicts nothing of that: by
  // how much it differs from one under the laws is counted as error.
  [[nodiscard]] double chi_square(const SteadyState& state) const {
    if (is_found(state)) return state.chi_square;
    return state.chi_square + state.unsettled * state.unsettled * numbers_;
  }

 private:
  // Of a model without laws the motion is its own, whatever that is worth.
  [[nodiscard]] bool is_found(const SteadyState& state) const {
    return model_.laws.empty() || is_settled(state.unsettled, state.chi_square, numbers_);
  }

  const ModelState& model_;
  double numbers_;  // of each recording
};

// J^T J, J^T r and r^T r of all parameters over some recordings.
struct Linearised {
  MatrixXd information;
  VectorXd scores;
  double chi_square = 0.0;
};
Linearised linearised(const PlantFamily& family, const PeriodicData& data, const ModelState& model,
                      const std::vector<MeasuredRecord>& records, int threads) {
  const Prediction prediction(data, model, records);
  std::vector<Linearised> sums(records.size());
  for_each_record(
      family, data, records, threads,
      [&](SteadyStateSolver& solver, const MeasuredRecord& record, std::size_t i, std::size_t) {
        const SteadyState& state = prediction.solve(solver, record);
        VectorXcd residual = state.residual.reshaped();
        MatrixXcd jacobian;
        solver.differentiate(model, record, true, jacobian);
        record.decorrelate(residual);
        record.decorrelate(jacobian);
        sums[i] = {as_real(jacobian).transpose() * as_real(jacobian),
                   as_real(jacobian).transpose() * as_real(residual), prediction.chi_square(state)};
      });
  Linearised total = sums.front();
  for (std::size_t i = 1; i < sums.size(); ++i) {
    total.information += sums[i].information;
    total.scores += sums[i].scores;
    total.chi_square += sums[i].chi_square;
  }
  return total;
}

}  // namespace

Assessment assess_records(const PlantFamily& family, const PeriodicData& data,
                          const ModelState& model, const std::vector<MeasuredRecord>& records,
                          std::size_t parameters, int threads) {
  const auto outputs = static_cast<Index>(data.outputs.size());
  const Prediction prediction(data, model, records);
  std::vector<double> chi_square(records.size());
  std::vector<VectorXd> error(records.size()), signal(records.size());
  for_each_record(
      family, data, records, threads,
      [&](SteadyStateSolver& solver, const MeasuredRecord& record, std::size_t i, std::size_t) {
        const SteadyState& state = prediction.solve(solver, record);
        chi_square[i] = prediction.chi_square(state);
        const Index count = data.line_count();
        error[i] = (record.output - state.output).rightCols(count).rowwise().squaredNorm();
        signal[i] = record.output.rightCols(count).rowwise().squaredNorm();
      });
  double sum = 0.0;
  VectorXd errors = VectorXd::Zero(outputs), signals = VectorXd::Zero(outputs);
  for (std::size_t i = 0; i < records.size(); ++i) {
    sum += chi_square[i];
    errors += error[i];
    signals += signal[i];
  }
  Assessment result =
      judged(data, records, sum, data.numbers_in(records) - static_cast<double>(parameters));
  const double share = errors.cwiseQuotient(signals).mean();
  result.nrmse = 100.0 * std::sqrt(share);
  result.variance_accounted_for = 100.0 * (1.0 - share);
  return result;
}

HeldOutPrediction predict_held_out(const PlantFamily& family, const PeriodicData& data,
                                   const ModelState& model, const VectorXd& values, int threads) {
  const Linearised fitted = linearised(family, data, model, data.estimation, threads);
  const Linearised held_out = linearised(family, data, model, data.validation, threads);
  const MatrixXd all = fitted.information + held_out.information;
  const double numbers = data.numbers_in(data.validation);
  const double unexplained =
      held_out.chi_square - held_out.scores.dot(solve_information(all, held_out.scores).col(0));
  HeldOutPrediction prediction{judged(data, data.validation, unexplained, numbers), {}};
  const double scale = prediction.within_errors.degrees_of_freedom / numbers;
  prediction.cost = prediction.within_errors.chi_square / scale +
                    log_determinant_with_prior(all, values) -
                    log_determinant_with_prior(fitted.information, values);
  // A force that no number describes where it was not fitted.
  if (!std::isfinite(*prediction.cost)) {
    prediction.cost = std::numeric_limits<double>::infinity();
  }
  return prediction;
}

MatrixXd solve_information(const MatrixXd& information, const MatrixXd& scores) {
  const VectorXd unit = information.diagonal().unaryExpr(
      [](double value) { return value > 0.0 ? 1.0 / std::sqrt(value) : 0.0; });
  const MatrixXd scaled = unit.asDiagonal() * information * unit.asDiagonal();
  return unit.asDiagonal() *
         scaled.completeOrthogonalDecomposition().solve(unit.asDiagonal() * scores);
}

double log_determinant_with_prior(const MatrixXd& information, const VectorXd& values) {
  if (values.size() == 0) return 0.0;
  const MatrixXd whole = values.asDiagonal() * information * values.asDiagonal();
  if (!whole.allFinite()) return std::numeric_limits<double>::infinity();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(whole, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().array().max(0.0).log1p().sum();
}

}  // namespace graybox
