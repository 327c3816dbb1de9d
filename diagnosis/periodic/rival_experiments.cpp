#include "diagnosis/periodic/rival_experiments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <utility>

#include "diagnosis/harmonic_balance/period_transform.hpp"
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
  std::vector<ExperimentOption> described_options;
  for (const Option& option : options) {
    described_options.push_back(described(option, *templates[option.position].front(), data));
  }
  const std::vector<MatrixXd> further(tasks.begin() + static_cast<std::ptrdiff_t>(known),
                                      tasks.end());
  return rival_experiment_set(now, further, std::move(described_options),
                              static_cast<double>(known));
}

}  // namespace graybox
