#include "diagnosis/responses/periodic_response.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <numbers>
#include <string>

#include "diagnosis/responses/closed_loop_bias.hpp"
#include "diagnosis/responses/covariance_pool.hpp"
#include "diagnosis/responses/distortion.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;

constexpr double kLeastIndependence = 1e-9;  // reciprocal condition of U with rows of length 1

struct LineColumns {
  MatrixXcd outputs;     // Y
  MatrixXcd inputs;      // U
  MatrixXcd references;  // R
  MatrixXcd samples;     // noise of outputs over noise of inputs
};

LineColumns columns_at(const std::vector<const PeriodicRecord*>& records, std::size_t line,
                       Index outputs, Index inputs, Index references) {
  const auto count = static_cast<Index>(records.size());
  const auto k = static_cast<Index>(line);
  Index samples = 0;
  for (const PeriodicRecord* record : records) samples += record->spectra.samples[line].cols();
  LineColumns columns{MatrixXcd(outputs, count), MatrixXcd(inputs, count),
                      MatrixXcd(references, count), MatrixXcd(outputs + inputs, samples)};
  Index next = 0;
  for (Index e = 0; e < count; ++e) {
    const LineSpectra& spectra = records[static_cast<std::size_t>(e)]->spectra;
    columns.outputs.col(e) = spectra.values.col(k).head(outputs);
    columns.inputs.col(e) = spectra.values.col(k).segment(outputs, inputs);
    columns.references.col(e) = spectra.values.col(k).tail(references);
    const MatrixXcd& noise = spectra.samples[line];
    columns.samples.middleCols(next, noise.cols()) = noise.topRows(outputs + inputs);
    next += noise.cols();
  }
  return columns;
}

// Units must not decide: rows are brought to length 1 first.
bool independent(const MatrixXcd& rows) {
  MatrixXcd scaled = rows;
  for (Index i = 0; i < rows.rows(); ++i) {
    const double length = rows.row(i).norm();
    if (!(length > 0.0)) return false;
    scaled.row(i) /= length;
  }
  const Eigen::VectorXd singular = Eigen::JacobiSVD<MatrixXcd>(scaled).singularValues();
  return singular.tail(1)(0) > kLeastIndependence * singular(0);
}

// W with U W = I, n x n_u; empty if the inputs are not independent.
MatrixXcd weights_of(const LineColumns& columns, std::size_t realisations) {
  const MatrixXcd& u = columns.inputs;
  if (columns.references.rows() == u.rows() && realisations > 1) {
    const MatrixXcd& r = columns.references;
    if (!independent(u) || !independent(r)) return {};
    return r.adjoint() * (u * r.adjoint()).inverse();
  }
  const auto count = static_cast<Index>(realisations);
  const Index each = u.cols() / count;
  MatrixXcd weights(u.cols(), u.rows());
  for (Index m = 0; m < count; ++m) {
    const MatrixXcd part = u.middleCols(m * each, each);
    if (!independent(part)) return {};
    weights.middleRows(m * each, each) =
        part.adjoint() * (part * part.adjoint()).inverse() / static_cast<double>(count);
  }
  return weights;
}

LineScatter noise_scatter(const LineColumns& columns, const MatrixXcd& response,
                          const std::vector<std::size_t>& bins) {
  const Index outputs = columns.outputs.rows();
  const MatrixXcd noise = columns.samples.topRows(outputs) -
                          response * columns.samples.bottomRows(columns.inputs.rows());
  return {noise * noise.adjoint(), static_cast<double>(noise.cols()), bins};
}

LineScatter total_scatter(const LineColumns& columns, const MatrixXcd& response,
                          const MatrixXcd& weights) {
  const Index count = columns.inputs.cols();
  const MatrixXcd residual = columns.outputs - response * columns.inputs;
  const MatrixXcd left = MatrixXcd::Identity(count, count) - weights * columns.inputs;
  const MatrixXcd gram = left * left.adjoint();
  const double trace = gram.trace().real();
  const double dof = trace * trace / gram.squaredNorm();
  return {(dof / trace) * (residual * residual.adjoint()), dof, {}};
}

[[noreturn]] void fail_dependent(const FrequencyResponseEstimate& estimate, std::size_t line,
                                 const std::string& place) {
  throw InputError(fmt::format(
      "{}: at line {} ({:.4g} Hz) the inputs of the sub-experiments are not independent of each "
      "other; excite every input there, each sub-experiment in another combination",
      place, estimate.lines[line], estimate.frequencies[line] / (2.0 * std::numbers::pi)));
}

// Samples of the noise of lines that were pooled with line k, so that there are enough of them.
MatrixXcd samples_about(const std::vector<LineColumns>& columns, std::size_t line,
                        std::size_t pooled) {
  const std::size_t first = line - std::min(line, pooled / 2);
  const std::size_t last = std::min(first + pooled, columns.size());
  Index count = 0;
  for (std::size_t l = first; l < last; ++l) count += columns[l].samples.cols();
  MatrixXcd samples(columns[line].samples.rows(), count);
  Index next = 0;
  for (std::size_t l = first; l < last; ++l) {
    samples.middleCols(next, columns[l].samples.cols()) = columns[l].samples;
    next += columns[l].samples.cols();
  }
  return samples;
}

// Without references a mean over realisations keeps the bias of one.
void estimate_bias(const std::vector<LineColumns>& columns, FrequencyResponseEstimate& estimate) {
  const bool instrument = columns.front().references.rows() == columns.front().inputs.rows();
  const double share = instrument ? 1.0 : 1.0 / static_cast<double>(estimate.realisations);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const ClosedLoopBias bias =
        closed_loop_bias(estimate.responses[k], share * estimate.input_gram[k].inverse(),
                         samples_about(columns, k, estimate.noise[k].pooled_lines));
    estimate.bias.push_back(bias.bias);
    estimate.feedback_share.push_back(bias.share);
  }
}

std::size_t count_realisations(const std::vector<const PeriodicRecord*>& records) {
  std::size_t count = 1;
  for (std::size_t e = 1; e < records.size(); ++e) {
    count += records[e]->realisation != records[e - 1]->realisation ? 1U : 0U;
  }
  return count;
}

void estimate_covariances(const std::vector<LineColumns>& columns,
                          const std::vector<MatrixXcd>& weights,
                          const std::vector<std::vector<std::size_t>>& bins, double wanted,
                          FrequencyResponseEstimate& estimate) {
  std::vector<LineScatter> noise, total;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    if (columns[k].samples.cols() > 0) {
      noise.push_back(noise_scatter(columns[k], estimate.responses[k], bins[k]));
    }
    if (estimate.realisations > 1) {
      total.push_back(total_scatter(columns[k], estimate.responses[k], weights[k]));
    }
  }
  if (noise.size() == columns.size()) {
    estimate.noise = pool_covariances(noise, estimate.frequencies, wanted);
    estimate_bias(columns, estimate);
  }
  if (!total.empty()) estimate.total = pool_covariances(total, estimate.frequencies, wanted);
  estimate.nonlinearity_p_value = total_over_noise(estimate);
}

void examine_silent_lines(const std::vector<const PeriodicRecord*>& records,
                          FrequencyResponseEstimate& estimate) {
  std::vector<const LineSpectra*> spectra;
  for (const PeriodicRecord* record : records) spectra.push_back(&record->detection);
  estimate.detection = detect_distortion(
      spectra, detection_lines({estimate.period, estimate.periods, estimate.lines}), estimate);
}

}  // namespace

void estimate_periodic_response(const std::vector<const PeriodicRecord*>& records,
                                std::size_t references, const PeriodicResponseOptions& options,
                                const std::string& place, FrequencyResponseEstimate& estimate) {
  const auto outputs = static_cast<Index>(estimate.outputs.size());
  const auto inputs = static_cast<Index>(estimate.inputs.size());
  estimate.realisations = count_realisations(records);
  estimate.recordings = records.size();
  estimate.output_level.resize(outputs, static_cast<Index>(estimate.lines.size()));
  std::vector<LineColumns> columns;
  std::vector<MatrixXcd> weights;
  for (std::size_t k = 0; k < estimate.lines.size(); ++k) {
    columns.push_back(columns_at(records, k, outputs, inputs, static_cast<Index>(references)));
    weights.push_back(weights_of(columns[k], estimate.realisations));
    if (weights[k].size() == 0) fail_dependent(estimate, k, place);
    const MatrixXcd& y = columns[k].outputs;
    estimate.responses.push_back(y * weights[k]);
    estimate.input_gram.push_back(weights[k].adjoint() * weights[k]);
    estimate.output_level.col(static_cast<Index>(k)) =
        y.rowwise().norm() / std::sqrt(static_cast<double>(y.cols()));
  }
  const double wanted = options.degrees_of_freedom > 0.0
                            ? options.degrees_of_freedom
                            : std::max(8.0, 4.0 * static_cast<double>(outputs));
  estimate_covariances(columns, weights, records.front()->spectra.bins, wanted, estimate);
  examine_silent_lines(records, estimate);
}

}  // namespace graybox
