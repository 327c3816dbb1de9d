#include "diagnosis/responses/local_polynomial.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;

// Sizes of one local regression.
struct Window {
  Index half;     // n
  Index records;  // E
  Index drives;   // columns of what drives: inputs, or references
  int order;      // R

  [[nodiscard]] Index equations() const { return records * (2 * half + 1); }
  [[nodiscard]] Index unknowns() const { return (order + 1) * (drives + records); }
  [[nodiscard]] Index degrees_of_freedom() const { return equations() - unknowns(); }
};

struct Channels {
  Index outputs, inputs;
  bool joint;  // from references to outputs and inputs
};

// K: drives and records by powers of the offset, [unknowns x equations]; powers run fastest.
MatrixXcd regressors(const std::vector<MatrixXcd>& records, Index bin, Index first_drive,
                     const Window& window) {
  MatrixXcd k = MatrixXcd::Zero(window.unknowns(), window.equations());
  const Index terms = window.order + 1;
  Index column = 0;
  for (Index e = 0; e < window.records; ++e) {
    const MatrixXcd& spectra = records[static_cast<std::size_t>(e)];
    for (Index o = -window.half; o <= window.half; ++o, ++column) {
      double power = 1.0;
      for (Index r = 0; r < terms; ++r) {
        for (Index d = 0; d < window.drives; ++d) {
          k(d * terms + r, column) = power * spectra(bin + o, first_drive + d);
        }
        k((window.drives + e) * terms + r, column) = power;
        power *= static_cast<double>(o) / static_cast<double>(window.half);
      }
    }
  }
  return k;
}

// Channels first ... first + count - 1 over the same equations.
MatrixXcd responses_at(const std::vector<MatrixXcd>& records, Index bin, Index first, Index count,
                       const Window& window) {
  const Index width = 2 * window.half + 1;
  MatrixXcd columns(count, window.equations());
  for (Index e = 0; e < window.records; ++e) {
    columns.middleCols(e * width, width) = records[static_cast<std::size_t>(e)]
                                               .block(bin - window.half, first, width, count)
                                               .transpose();
  }
  return columns;
}

struct LocalEstimate {
  MatrixXcd response, gram, covariance;
};

// Empty response where the drives do not vary independently in this window.
LocalEstimate estimate_at(const std::vector<MatrixXcd>& records, Index bin,
                          const Channels& channels, const Window& window) {
  const Index first_drive = channels.joint ? channels.outputs + channels.inputs : channels.outputs;
  const Index responding = channels.joint ? channels.outputs + channels.inputs : channels.outputs;
  MatrixXcd k = regressors(records, bin, first_drive, window).adjoint();
  const Eigen::VectorXd scale = k.colwise().norm().cwiseMax(1e-300);
  k = k * scale.cwiseInverse().asDiagonal();
  const Eigen::ColPivHouseholderQR<MatrixXcd> qr(k);
  if (qr.rank() < k.cols()) return {};
  const MatrixXcd z = responses_at(records, bin, 0, responding, window);
  const MatrixXcd solution = qr.solve(z.adjoint());
  const MatrixXcd residual = z - (k * solution).adjoint();
  // Columns of the pseudo-inverse that belong to the zeroth powers of the drives.
  MatrixXcd chosen = MatrixXcd::Zero(k.cols(), window.drives);
  MatrixXcd response(responding, window.drives);
  for (Index d = 0; d < window.drives; ++d) {
    const Index at = d * (window.order + 1);
    chosen(at, d) = 1.0 / scale(at);
    response.col(d) = solution.row(at).adjoint() / scale(at);
  }
  // G_0 = Z k (k^H k)^-1 chosen: gram = chosen^H (k^H k)^-1 chosen.
  const MatrixXcd factor = qr.matrixQR().topRows(k.cols()).triangularView<Eigen::Upper>();
  const MatrixXcd half = factor.adjoint().triangularView<Eigen::Lower>().solve(
      MatrixXcd(qr.colsPermutation().transpose() * chosen));
  LocalEstimate result{response, half.adjoint() * half, {}};
  MatrixXcd noise = residual;
  if (channels.joint) {
    const MatrixXcd inverse = response.bottomRows(channels.inputs).inverse();
    result.response = response.topRows(channels.outputs) * inverse;
    result.gram = inverse.adjoint() * result.gram * inverse;
    noise =
        residual.topRows(channels.outputs) - result.response * residual.bottomRows(channels.inputs);
  }
  result.covariance = noise * noise.adjoint() / static_cast<double>(window.degrees_of_freedom());
  return result;
}

Window window_for(Index records, Index drives, const LocalPolynomialOptions& options,
                  double wanted) {
  Window window{1, records, drives, options.order};
  while (static_cast<double>(window.degrees_of_freedom()) < wanted) ++window.half;
  return window;
}

// Bins nearest to log-spaced frequencies, each once.
std::vector<Index> chosen_bins(std::size_t samples, double sample_time, const Window& window,
                               const LocalPolynomialOptions& options, const std::string& place) {
  const double resolution = 1.0 / (static_cast<double>(samples) * sample_time);
  // Neither zero frequency, where offsets are, nor the Nyquist frequency.
  const Index lowest = window.half + 1;
  const Index highest = static_cast<Index>(samples - 1) / 2 - window.half;
  const auto bin_of = [&](double hertz) {
    return static_cast<Index>(std::llround(hertz / resolution));
  };
  const Index first = options.from > 0.0 ? bin_of(options.from) : lowest;
  const Index last = options.to > 0.0 ? bin_of(options.to) : highest;
  if (lowest > highest) {
    throw InputError(fmt::format(
        "{}: {} samples are too few for windows of {} bins; use longer records, more of them, or a "
        "lower order",
        place, samples, 2 * window.half + 1));
  }
  if (first < lowest || last > highest || first > last) {
    throw InputError(fmt::format(
        "{}: frequencies must rise from {:.4g} Hz or more to {:.4g} Hz or less: windows of {} bins "
        "of {:.4g} Hz must fit",
        place, static_cast<double>(lowest) * resolution, static_cast<double>(highest) * resolution,
        2 * window.half + 1, resolution));
  }
  std::vector<Index> bins;
  const double ratio = static_cast<double>(last) / static_cast<double>(first);
  for (std::size_t k = 0; k < options.count; ++k) {
    const double share =
        options.count == 1 ? 0.0 : static_cast<double>(k) / static_cast<double>(options.count - 1);
    const auto bin =
        static_cast<Index>(std::llround(static_cast<double>(first) * std::pow(ratio, share)));
    if (bins.empty() || bin > bins.back()) bins.push_back(bin);
  }
  return bins;
}

}  // namespace

void estimate_local_polynomial(const std::vector<MatrixXcd>& records, std::size_t samples,
                               std::size_t references, const LocalPolynomialOptions& options,
                               const std::string& place, FrequencyResponseEstimate& estimate) {
  const Channels channels{static_cast<Index>(estimate.outputs.size()),
                          static_cast<Index>(estimate.inputs.size()),
                          options.joint && references == estimate.inputs.size()};
  const double wanted = options.degrees_of_freedom > 0.0
                            ? options.degrees_of_freedom
                            : std::max(8.0, 4.0 * static_cast<double>(channels.outputs));
  const Window window =
      window_for(static_cast<Index>(records.size()), channels.inputs, options, wanted);
  const std::vector<Index> bins =
      chosen_bins(samples, estimate.sample_time, window, options, place);
  estimate.method = ResponseMethod::kLocalPolynomial;
  estimate.recordings = records.size();
  estimate.output_level.resize(channels.outputs, static_cast<Index>(bins.size()));
  for (std::size_t k = 0; k < bins.size(); ++k) {
    const double w = 2.0 * std::numbers::pi * static_cast<double>(bins[k]) /
                     (static_cast<double>(samples) * estimate.sample_time);
    const LocalEstimate local = estimate_at(records, bins[k], channels, window);
    if (local.response.size() == 0) {
      throw InputError(fmt::format(
          "{}: about {:.4g} Hz the inputs do not vary independently of each other; use more "
          "records, or frequencies that are excited",
          place, w / (2.0 * std::numbers::pi)));
    }
    estimate.frequencies.push_back(w);
    estimate.responses.push_back(local.response);
    estimate.input_gram.push_back(local.gram);
    estimate.noise.push_back(
        {local.covariance, static_cast<double>(window.degrees_of_freedom()), 1});
    const MatrixXcd y = responses_at(records, bins[k], 0, channels.outputs, window);
    estimate.output_level.col(static_cast<Index>(k)) =
        y.rowwise().norm() / std::sqrt(static_cast<double>(y.cols()));
  }
}

}  // namespace graybox
