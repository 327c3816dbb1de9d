#include "diagnosis/robot_fits/robot_line_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnosis/free_motion/transients.hpp"
#include "diagnosis/harmonic_balance/noise_whitening.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "diagnosis/periodic/cleared_fit.hpp"

namespace graybox {
namespace {

constexpr double kAtRest = 0.02;  // standard errors

struct RecordSums {
  double chi_square = 0.0, error_power = 0.0, signal_power = 0.0;
  Eigen::MatrixXd information;
};

// Of each record by itself, so that sums do not depend on the threads.
std::vector<RecordSums> sums_of(const PlantFamily& family, const Eigen::VectorXd& theta,
                                const PeriodicData& data,
                                const std::vector<MeasuredRecord>& records, bool with_information,
                                int threads) {
  const ModelState model = evaluate_model(family, data, theta, {}, with_information, threads);
  std::vector<RecordSums> sums(records.size());
#pragma omp parallel num_threads(threads)
  {
    SteadyStateSolver solver(family, data, {});
    Eigen::MatrixXcd jacobian;
#pragma omp for schedule(dynamic)
    for (std::size_t i = 0; i < records.size(); ++i) {
      const SteadyState& state = solver.solve(model, records[i], nullptr);
      const auto count = data.line_count();
      sums[i].chi_square = state.chi_square;
      sums[i].error_power = (records[i].output - state.output).rightCols(count).squaredNorm();
      sums[i].signal_power = records[i].output.rightCols(count).squaredNorm();
      if (!with_information) continue;
      solver.differentiate(model, records[i], true, jacobian);
      records[i].decorrelate(jacobian);
      sums[i].information = (jacobian.adjoint() * jacobian).real();
    }
  }
  return sums;
}

}  // namespace

LineFit fit_lines(const PlantFamily& family, const Eigen::VectorXd& start,
                  const LineFitOptions& options, PeriodicData& data) {
  PeriodicDataOptions noise;
  noise.noise_samples = options.noise_samples;
  noise.threads = options.threads;
  if (data.whitening.empty()) {
    std::size_t groups = 0;
    for (const MeasuredRecord& record : data.estimation) {
      groups = std::max(groups, record.group + 1);
    }
    data.whitening = whitening_between_lines(data, groups, noise.model_accuracy);
    data.noise_pools.resize(groups);
  }
  PeriodicFitOptions how;
  how.tolerance = 1e-8;
  how.threads = options.threads;
  how.keep_going = options.keep_going;
  PeriodicFit near;
  near.parameters = start;
  const ClearedFit cleared = fit_and_clear_transients(family, near, noise, how, kAtRest, data);
  LineFit result;
  FitResult& fit = result.fit;
  fit.theta = start;
  if (!cleared.fit.converged) return result;
  fit.theta = cleared.fit.parameters;
  fit.information = cleared.fit.information;
  for (const RecordSums& each :
       sums_of(family, fit.theta, data, data.estimation, false, options.threads)) {
    fit.chi_square += each.chi_square;
  }
  const Eigen::Index d = start.size();
  fit.degrees_of_freedom =
      static_cast<std::size_t>(data.numbers_in(data.estimation)) - static_cast<std::size_t>(d);
  result.noise_samples = data.noise_pools.empty() ? 0.0 : data.noise_pools.front().samples;
  const Eigen::LLT<Eigen::MatrixXd> factor(fit.information);
  if (factor.info() != Eigen::Success || !(factor.rcond() > 1e-14)) {
    fit.status = FitStatus::kSingular;
    return result;
  }
  const double kappa =
      result.noise_samples > 0.0
          ? weights_widening(result.noise_samples, static_cast<Eigen::Index>(data.outputs.size()))
          : 1.0;
  fit.covariance = kappa * factor.solve(Eigen::MatrixXd::Identity(d, d));
  fit.status = cleared.moved <= kAtRest ? FitStatus::kConverged : FitStatus::kIterationLimit;
  return result;
}

FitQuality line_fit_quality(const PlantFamily& family, const Eigen::VectorXd& theta,
                            const PeriodicData& data, const std::vector<MeasuredRecord>& records,
                            double expected_excess, int threads) {
  RecordSums total;
  for (const RecordSums& each : sums_of(family, theta, data, records, false, threads)) {
    total.chi_square += each.chi_square;
    total.error_power += each.error_power;
    total.signal_power += each.signal_power;
  }
  const double share = total.error_power / total.signal_power;
  return {.recordings = records.size(),
          .chi_square_per_dof = total.chi_square / (data.numbers_in(records) + expected_excess),
          .nrmse = 100.0 * std::sqrt(share),
          .variance_accounted_for = 100.0 * (1.0 - share)};
}

Eigen::MatrixXd line_fit_information(const PlantFamily& family, const Eigen::VectorXd& theta,
                                     const PeriodicData& data,
                                     const std::vector<MeasuredRecord>& records, int threads) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(theta.size(), theta.size());
  for (const RecordSums& each : sums_of(family, theta, data, records, true, threads)) {
    sum += each.information;
  }
  return sum;
}

}  // namespace graybox
