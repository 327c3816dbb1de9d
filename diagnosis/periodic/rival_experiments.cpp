#include "diagnosis/periodic/rival_experiments.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <utility>

#include "diagnosis/harmonic_balance/period_transform.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array<double, 3> kLevelFactors{0.5, 1.0, 2.0};
constexpr int kThirds = 3;
constexpr std::size_t kTemplates = 2;

// The tolerance of steady states, in whitened rms. Explanations are one system where they differ by
// a fiftieth over all lines of all recordings (diagnosis_search.hpp); the tolerance of fits would
// hide that.
constexpr double kTolerance = 1e-4;

// Excited lines from `first` to `last`; the whole band, then its thirds.
struct Band {
  std::size_t first = 0, last = 0;
};

std::vector<Band> bands_of(const PeriodicData& data) {
  const std::size_t from = data.excited.front(), to = data.excited.back();
  std::vector<Band> bands{{from, to}};
  const double width = std::log(static_cast<double>(to) / static_cast<double>(from)) / kThirds;
  for (int third = 0; third < kThirds; ++third) {
    const double low = static_cast<double>(from) * std::exp(third * width);
    const double high = static_cast<double>(from) * std::exp((third + 1) * width);
    Band band{std::numeric_limits<std::size_t>::max(), 0};
    for (const std::size_t line : data.excited) {
      if (static_cast<double>(line) < low * (1.0 - 1e-12)) continue;
      if (static_cast<double>(line) > high * (1.0 + 1e-12)) continue;
      band.first = std::min(band.first, line);
      band.last = std::max(band.last, line);
    }
    if (band.first <= band.last) bands.push_back(band);
  }
  return bands;
}

// The record with the inputs of this band alone, as strong as all were, times `factor`.
MeasuredRecord excited_in(const MeasuredRecord& record, const Band& band, double factor,
                          const PeriodicData& data) {
  MeasuredRecord result = record;
  const auto first = static_cast<Index>(band.first),
             count = static_cast<Index>(band.last) - first + 1;
  const bool is_whole = band.first == data.excited.front() && band.last == data.excited.back();
  if (is_whole) {
    result.input *= factor;
    result.output *= factor;
    result.input_period *= factor;
    result.mean_offset *= factor;  // from a start at rest it is less the motion there
    return result;
  }
  result.input.setZero();
  result.output.setZero();
  for (Index c = 0; c < record.input.rows(); ++c) {
    const double all = record.input.row(c).tail(record.input.cols() - 1).norm();
    const double inside = record.input.row(c).segment(first, count).norm();
    const double scale = inside > 0.0 ? factor * all / inside : 0.0;
    result.input.row(c).segment(first, count) = scale * record.input.row(c).segment(first, count);
  }
  result.output.middleCols(first, count) = factor * record.output.middleCols(first, count);
  // Two points a sample: the last line below half the sample rate needs more than the samples.
  PeriodTransform transform(data.period, first + count - 1, 2 * data.period);
  VectorXd times(transform.grid());
  for (Index c = 0; c < result.input.rows(); ++c) {
    transform.to_times(result.input.row(c).head(first + count).transpose(), times);
    for (Index t = 0; t < result.input_period.cols(); ++t) {
      result.input_period(c, t) = times(2 * t);
    }
  }
  return result;
}

struct Comparison {
  MatrixXd information;  // [J  y_B - y_A]^T [J  y_B - y_A]
  bool is_found = true;  // the steady state under each rival's laws
};

// Of one record, with so many numbers.
Comparison compare(SteadyStateSolver& solver, MeasuredRecord record, const ModelState& a,
                   const ModelState& b, double numbers) {
  const auto is_found = [&](const ModelState& model) {
    const SteadyState& state = solver.state();
    return model.laws.empty() || is_settled(state.unsettled, state.chi_square, numbers);
  };
  Comparison result;
  MatrixXcd jacobian;
  // A's own answer takes the place of the recording: the start of B's iteration is B's explanation
  // of it.
  record.output = solver.solve(a, record, nullptr).output;
  result.is_found = is_found(a);
  solver.solve(a, record, nullptr);
  result.is_found = result.is_found && is_found(a);
  solver.differentiate(a, record, true, jacobian);
  const MatrixXcd difference = -solver.solve(b, record, nullptr).residual;
  result.is_found = result.is_found && is_found(b);
  MatrixXcd columns(jacobian.rows(), jacobian.cols() + 1);
  columns.leftCols(jacobian.cols()) = jacobian;
  columns.rightCols(1) = Eigen::Map<const Eigen::VectorXcd>(difference.data(), difference.size());
  record.decorrelate(columns);
  result.information = (columns.adjoint() * columns).real();
  return result;
}

// Records of each position at its largest level; two tell about as much as all that differ in their
// random phases.
std::vector<std::vector<const MeasuredRecord*>> templates_of(const PeriodicData& data) {
  std::vector<std::vector<const MeasuredRecord*>> templates(data.positions.size());
  for (const MeasuredRecord& record : data.estimation) {
    auto& list = templates[record.position];
    if (!list.empty() && record.level < list.front()->level) continue;
    if (!list.empty() && record.level > list.front()->level) list.clear();
    if (list.size() < kTemplates) list.push_back(&record);
  }
  return templates;
}

// Schur complement of the last diagonal entry; none where the others are singular or any is no
// number.
std::optional<double> distance_in(const MatrixXd& information) {
  const Index n = information.rows() - 1;
  if (!information.allFinite()) return {};
  if (information(n, n) == 0.0) return 0.0;  // both explain the same
  const VectorXd scale = information.diagonal().cwiseSqrt();
  if (!(scale.minCoeff() > 0.0)) return {};
  const MatrixXd scaled =
      scale.cwiseInverse().asDiagonal() * information * scale.cwiseInverse().asDiagonal();
  const Eigen::LLT<MatrixXd> factor(scaled.topLeftCorner(n, n));
  if (factor.info() != Eigen::Success) return {};
  const VectorXd half = factor.matrixL().solve(scaled.col(n).head(n));
  return std::max(0.0, (scaled(n, n) - half.squaredNorm())) * information(n, n);
}

struct Option {
  std::size_t position = 0;
  double factor = 1.0;
  Band band;
};

std::vector<Option> options_of(const PeriodicData& data,
                               const std::vector<std::vector<const MeasuredRecord*>>& templates) {
  std::vector<Option> options;
  for (std::size_t p = 0; p < templates.size(); ++p) {
    if (templates[p].empty()) continue;
    for (const double factor : kLevelFactors) {
      for (const Band& band : bands_of(data)) options.push_back({p, factor, band});
    }
  }
  return options;
}

ExperimentOption described(const Option& option, const MeasuredRecord& record,
                           const PeriodicData& data) {
  ExperimentOption result;
  result.position = data.position_names[option.position];
  const VectorXd degrees = data.positions[option.position] * (180.0 / std::numbers::pi);
  result.position_degrees.assign(degrees.begin(), degrees.end());
  result.level = option.factor * record.level;
  result.from = data.frequencies[option.band.first] / (2.0 * std::numbers::pi);
  result.to = data.frequencies[option.band.last] / (2.0 * std::numbers::pi);
  return result;
}

// Units of the parameters that make the diagonal of M_0 one; s keeps its own.
VectorXd parameter_scale(const MatrixXd& information) {
  VectorXd scale = information.diagonal().cwiseSqrt();
  scale(scale.size() - 1) = 1.0;
  return scale;
}

}  // namespace

std::optional<RivalExperiments> rival_experiments(const PlantFamily& family,
                                                  const PeriodicData& data, const ModelState& a,
                                                  const ModelState& b, int threads) {
  const auto templates = templates_of(data);
  const std::vector<Option> options = options_of(data, templates);
  const std::size_t known = data.estimation.size();
  const double numbers = data.numbers_in(data.estimation) / static_cast<double>(known);
  std::vector<MatrixXd> tasks(known + options.size());
  const StopClock clock;
#pragma omp parallel num_threads(threads)
  {
    SteadyStateSolver solver(family, data, {.tolerance = kTolerance});
#pragma omp for schedule(dynamic)
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      if (clock.stops()) continue;
      if (i < known) {
        // These were fitted, and are there whatever a search leaves.
        tasks[i] = compare(solver, data.estimation[i], a, b, numbers).information;
        continue;
      }
      const Option& option = options[i - known];
      const auto& records = templates[option.position];
      bool is_found = true;
      for (const MeasuredRecord* record : records) {
        const Comparison one =
            compare(solver, excited_in(*record, option.band, option.factor, data), a, b, numbers);
        is_found = is_found && one.is_found;
        tasks[i] = tasks[i].size() == 0 ? one.information : MatrixXd(tasks[i] + one.information);
      }
      // What is left of a search would pass for a difference: such an experiment promises nothing.
      if (!is_found) tasks[i].setZero();
      tasks[i] *= static_cast<double>(known) / static_cast<double>(records.size());
    }
  }
  stop_if_requested();
  MatrixXd now = MatrixXd::Zero(tasks.front().rows(), tasks.front().cols());
  for (std::size_t i = 0; i < known; ++i) now += tasks[i];
  // Parameters that are known have no columns.
  std::vector<Index> free;
  for (Index p = 0; p + 1 < now.rows(); ++p) {
    if (now(p, p) > 0.0) free.push_back(p);
  }
  if (free.empty()) return {};
  free.push_back(now.rows() - 1);
  now = MatrixXd(now(free, free));
  const std::optional<double> distance_now = distance_in(now);
  if (!distance_now) return {};
  const VectorXd scale = parameter_scale(now);
  const auto dimension = static_cast<std::size_t>(now.rows());
  const std::size_t packed = packed_size(dimension);
  AlignedArray information(options.size() * packed);
  RivalExperiments result{{}, InformationSet(dimension, AlignedArray(packed))};
  for (std::size_t i = 0; i < options.size(); ++i) {
    const MatrixXd then = now + tasks[known + i](free, free);
    const MatrixXd scaled =
        scale.cwiseInverse().asDiagonal() * then * scale.cwiseInverse().asDiagonal();
    const std::optional<double> distance = distance_in(then);
    if (!distance) return {};
    result.distance_at_best = std::max(result.distance_at_best, *distance);
    pack(scaled.data(), dimension, information.data() + i * packed);
    result.options.push_back(described(options[i], *templates[options[i].position].front(), data));
  }
  result.information = InformationSet(dimension, std::move(information), {}, {}, "next experiment");
  result.distance_now = *distance_now;
  result.recordings = static_cast<double>(known);
  return result;
}

}  // namespace graybox
