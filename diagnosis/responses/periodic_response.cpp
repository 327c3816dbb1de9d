#include "graybox/diagnosis/responses/periodic_response.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <numbers>
#include <string>

#include "graybox/diagnosis/responses/covariance_pool.hpp"
#include "graybox/problems/error.hpp"

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

}  // namespace

void estimate_periodic_response(const std::vector<const PeriodicRecord*>& records,
                                std::size_t references, const PeriodicResponseOptions& options,
                                const std::string& place, FrequencyResponseEstimate& estimate) {
  const auto outputs = static_cast<Index>(estimate.outputs.size());
  const auto inputs = static_cast<Index>(estimate.inputs.size());
  std::size_t realisations = 1;
  for (std::size_t e = 1; e < records.size(); ++e) {
    realisations += records[e]->realisation != records[e - 1]->realisation ? 1U : 0U;
  }
  estimate.realisations = realisations;
  estimate.recordings = records.size();
  estimate.output_level.resize(outputs, static_cast<Index>(estimate.lines.size()));
  std::vector<LineScatter> noise, total;
  for (std::size_t k = 0; k < estimate.lines.size(); ++k) {
    const LineColumns columns =
        columns_at(records, k, outputs, inputs, static_cast<Index>(references));
    const MatrixXcd weights = weights_of(columns, realisations);
    if (weights.size() == 0) fail_dependent(estimate, k, place);
    const MatrixXcd response = columns.outputs * weights;
    if (columns.samples.cols() > 0) {
      noise.push_back(noise_scatter(columns, response, records.front()->spectra.bins[k]));
    }
    if (realisations > 1) total.push_back(total_scatter(columns, response, weights));
    estimate.output_level.col(static_cast<Index>(k)) =
        columns.outputs.rowwise().norm() / std::sqrt(static_cast<double>(columns.outputs.cols()));
    estimate.responses.push_back(response);
    estimate.input_gram.push_back(weights.adjoint() * weights);
  }
  const double wanted = options.degrees_of_freedom > 0.0 ? options.degrees_of_freedom
                                                         : 4.0 * static_cast<double>(outputs);
  if (noise.size() == estimate.lines.size()) {
    estimate.noise = pool_covariances(noise, estimate.frequencies, wanted);
  }
  if (!total.empty()) estimate.total = pool_covariances(total, estimate.frequencies, wanted);
}

}  // namespace graybox
