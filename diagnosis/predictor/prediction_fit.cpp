#include "diagnosis/predictor/prediction_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "diagnosis/predictor/left_out_blocks.hpp"
#include "diagnosis/predictor/predictor.hpp"
#include "diagnosis/predictor/stationary_gain.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kDifference = 3e-4;  // of a coordinate
constexpr double kLongestStep = 1.5;  // of a logarithmic coordinate
constexpr double kInitialDamping = 1e-3, kLeastDamping = 1e-9;
// Relative fall of the cost, twice in a row: kSettledNats over the samples that are independent.
constexpr double kSettledNats = 0.1, kSettled = 1e-5, kMostSettled = 3e-4;
constexpr int kSettledTwice = 2;
constexpr int kTrials = 8;  // of a damping, an iteration
constexpr double kAtBound = 1e-9;

bool wants_out(const ParameterSpace& space, double value, double slope) {
  const double low = space.low + kAtBound * std::abs(space.low);
  const double high = space.high - kAtBound * std::abs(space.high);
  return (value <= low && slope > 0.0) || (value >= high && slope < 0.0);
}

// The fall of the cost that counts. Residuals of a long free run over dry friction have memory, and
// their cost has corners: small falls there say nothing.
double least_fall(const VectorXd& residuals, Index outputs, bool is_free) {
  const Index n = residuals.size() - outputs;
  if (!is_free || n < 1) return kSettled;
  const double change = (residuals.tail(n) - residuals.head(n)).squaredNorm();
  const double apart = 0.5 * change / std::max(residuals.squaredNorm(), 1e-300);  // 1 - rho
  const double independent = static_cast<double>(n) * std::min(1.0, apart / (2.0 - apart));
  return std::clamp(kSettledNats / std::max(independent, 1.0), kSettled, kMostSettled);
}

double counted_rows(const PredictionFit& fit) {
  return static_cast<double>((fit.residuals.array() != 0.0).count());
}

VectorXd left_out(const PredictionFit& fit, const BlockEdges& edges) {
  return left_out_residuals(fit.residuals, fit.jacobian, edges, fit.initial_columns(),
                            fit.cost / std::max(counted_rows(fit), 1.0));
}

}  // namespace

double z_between(const PredictionFit& poorer, const PredictionFit& richer) {
  const BlockEdges& edges = richer.edges;
  return left_out_z(block_squares(left_out(poorer, edges), edges),
                    block_squares(left_out(richer, edges), edges),
                    counted_rows(richer) / static_cast<double>(edges.size() - 1));
}

double z_as_given(const PredictionFit& poorer, const PredictionFit& richer) {
  const BlockEdges& edges = richer.fine_edges;
  const double z = z_between(poorer, richer);
  if (edges.size() < 2) return z;
  return std::max(z, added_z(left_out(poorer, edges), left_out(richer, edges), edges));
}

PredictionFitter::PredictionFitter(const PredictionData& data, const PredictionTask& task,
                                   double intensity, int threads,
                                   const DisturbanceForce& disturbance)
    : data_(&data),
      task_(&task),
      intensity_(intensity),
      threads_(threads),
      disturbance_(disturbance) {}

// In free run no sample says what a disturbance is.
Predictor PredictionFitter::predictor_of(const ExtendedLumpedModel& model) const {
  return {model.model, data_->sample_time(), data_->steps_per_sample(),
          task_->is_free() ? DisturbanceForce{} : disturbance_};
}

InitialStates PredictionFitter::measured_initials(const LumpedModel& model) const {
  std::vector<Index> slots;  // of each coordinate among the free ones
  Index free = 0;
  for (const bool imposed : model.imposed) slots.push_back(imposed ? -1 : free++);
  InitialStates initials;
  for (const PredictionRun& run : task_->runs) {
    VectorXd initial = data_->measured_initial(run.recording);
    for (const Element& part : model.parts) {
      if (part.location.kind != LocationKind::kSensor || part.law_name != "offset") continue;
      const LumpedOutput& output = model.outputs[static_cast<std::size_t>(part.location.channel)];
      const Index slot = slots[static_cast<std::size_t>(output.mass)];
      if (slot < 0) continue;
      using enum LumpedOutput::Quantity;
      if (output.quantity == kPosition) initial(slot) -= part.parameters[0];
      if (output.quantity == kVelocity) initial(free + slot) -= part.parameters[0];
    }
    initials.push_back(std::move(initial));
  }
  return initials;
}

MatrixXd PredictionFitter::gain_of(const ExtendedLumpedModel& model) const {
  if (task_->is_free()) return {};
  Predictor predictor = predictor_of(model);
  return stationary_gain(predictor, model.model, data_->sample_time(), intensity_, data_->noise());
}

MatrixXd PredictionFitter::gain_for(const ExtendedLumpedModel& model, const MatrixXd& given,
                                    Predictor& predictor) const {
  if (task_->is_free() || given.rows() == predictor.state_count()) return given;
  return stationary_gain(predictor, model.model, data_->sample_time(), intensity_, data_->noise());
}

// What a thread needs to run a model.
struct PredictionFitter::Runner {
  Predictor predictor;
  DriveSignals signals;
  MatrixXd errors, states;
};

PredictionFitter::Runner PredictionFitter::runner_of(const ExtendedLumpedModel& model) const {
  return {predictor_of(model),
          DriveSignals(data_->recordings(), data_->hold(), data_->nodes()),
          {},
          {}};
}

bool PredictionFitter::run_one(std::size_t r, const ExtendedLumpedModel& model,
                               const InitialStates& initials, const MatrixXd& gain,
                               bool with_states, Runner& runner) const {
  const PredictionRun& run = task_->runs[r];
  const NodeInputs& drive = runner.signals.of(run.recording, model.model, data_->sample_time());
  const OutputErrorRecording& recording = data_->recording(run.recording);
  const bool whole = run.samples == recording.outputs.rows();
  const MatrixXd part = whole ? MatrixXd() : MatrixXd(recording.outputs.topRows(run.samples));
  return runner.predictor.run(drive, whole ? recording.outputs : part, run.forecasts(), gain,
                              initials[r], runner.errors, with_states ? &runner.states : nullptr);
}

// Rows of a run: sample by sample, all outputs.
void PredictionFitter::weigh(std::size_t r, const MatrixXd& errors, const VectorXd& weights,
                             Eigen::Ref<VectorXd> rows) const {
  const PredictionRun& run = task_->runs[r];
  const Index outputs = data_->output_count();
  Index next = 0;
  for (Index k = 0; k < run.samples; ++k) {
    const bool counts = run.counts(k);
    for (Index j = 0; j < outputs; ++j) {
      rows(next++) = counts ? errors(k, j) / weights(j) : 0.0;
    }
  }
}

std::vector<Index> PredictionFitter::first_rows() const {
  std::vector<Index> first{0};
  for (const PredictionRun& run : task_->runs) {
    first.push_back(first.back() + run.samples * data_->output_count());
  }
  return first;
}

bool PredictionFitter::residuals(const ExtendedLumpedModel& model, const VectorXd& weights,
                                 const InitialStates& initials, const MatrixXd& given,
                                 VectorXd& result) const {
  const std::vector<Index> first = first_rows();
  result.resize(first.back());
  Runner runner = runner_of(model);
  const MatrixXd gain = gain_for(model, given, runner.predictor);
  for (std::size_t r = 0; r < task_->runs.size(); ++r) {
    if (!run_one(r, model, initials, gain, false, runner)) return false;
    weigh(r, runner.errors, weights, result.segment(first[r], first[r + 1] - first[r]));
  }
  return true;
}

VectorXd PredictionFitter::errors_by_noise(const PredictionFit& fit, const VectorXd& weights,
                                           const DisturbanceForce& disturbance) const {
  Predictor predictor = predictor_of(fit.model);
  if (!task_->is_free()) {
    if (fit.gain.rows() != predictor.state_count()) return data_->noise();
    return error_by_noise(predictor, fit.gain, data_->noise(), task_->horizon, data_->sample_time(),
                          disturbance);
  }
  VectorXd noise = data_->noise();
  const Index outputs = data_->output_count();
  const Eigen::Map<const MatrixXd> table(fit.residuals.data(), outputs,
                                         fit.residuals.size() / outputs);
  for (Index j = 0; j < outputs; ++j) {
    if (data_->states_noise(j)) continue;
    const VectorXd rest = table.row(j).transpose() * weights(j);
    noise(j) = std::min(noise(j), std::max(noise_by_differences(rest), 1e-300));
  }
  return error_by_noise(predictor, {}, noise, 0, data_->sample_time(), disturbance);
}

MatrixXd PredictionFitter::motion(const PredictionFit& fit) const {
  const auto coordinates = static_cast<Index>(fit.model.model.imposed.size());
  MatrixXd all(task_->rows(1), 2 * coordinates);
  Runner runner = runner_of(fit.model);
  const MatrixXd gain = gain_for(fit.model, fit.gain, runner.predictor);
  Index next = 0;
  for (std::size_t r = 0; r < task_->runs.size(); ++r) {
    if (!run_one(r, fit.model, fit.initials, gain, true, runner)) {
      all.setZero();
      break;
    }
    all.middleRows(next, runner.states.rows()) = runner.states;
    next += runner.states.rows();
  }
  return all;
}

VectorXd PredictionFitter::errors(const PredictionFit& fit, const VectorXd& weights) const {
  const Index outputs = data_->output_count();
  const auto counted = static_cast<double>(task_->counted());
  const Eigen::Map<const MatrixXd> table(fit.residuals.data(), outputs,
                                         fit.residuals.size() / outputs);
  return (table.rowwise().squaredNorm() / std::max(counted, 1.0)).cwiseSqrt().cwiseProduct(weights);
}

bool PredictionFitter::evaluate(Point& point, const VectorXd& weights) const {
  if (!residuals(point.model, weights, point.initials, point.gain, point.residuals)) return false;
  point.cost = point.residuals.squaredNorm();
  return std::isfinite(point.cost);
}

Index PredictionFitter::initial_columns(const Point& at) const {
  Index count = 0;
  if (task_->is_free()) {
    for (const VectorXd& initial : at.initials) count += initial.size();
  }
  return count;
}

PredictionFitter::Point PredictionFitter::moved(const Point& from,
                                                std::span<const std::size_t> free,
                                                const VectorXd& step) const {
  Point point;
  std::vector<double> values = from.model.values();
  for (std::size_t i = 0; i < free.size(); ++i) {
    const ParameterSpace& space = from.model.space[free[i]];
    double change = step(static_cast<Index>(i));
    if (space.logarithmic) change = std::clamp(change, -kLongestStep, kLongestStep);
    if (change == 0.0) continue;
    values[free[i]] = space.value(space.coordinate(values[free[i]]) + change);
  }
  point.model = with_values(from.model, values);
  point.initials = from.initials;
  point.gain = from.gain;
  auto next = static_cast<Index>(free.size());
  if (next == step.size()) return point;
  for (std::size_t r = 0; r < point.initials.size(); ++r) {
    VectorXd& initial = point.initials[r];
    initial += step.segment(next, initial.size());
    next += initial.size();
    // The speed is the last of one mass's state.
    const double fastest = data_->largest_first_speed(task_->runs[r].recording);
    double& speed = initial(initial.size() - 1);
    speed = std::clamp(speed, -fastest, fastest);
  }
  return point;
}

double PredictionFitter::difference_step(const Point& at, std::span<const std::size_t> free,
                                         Index column) const {
  if (column >= static_cast<Index>(free.size())) {  // an initial state: by the outputs' size
    return kDifference * data_->output_scale().maxCoeff();
  }
  const std::size_t index = free[static_cast<std::size_t>(column)];
  const ParameterSpace& space = at.model.space[index];
  const double value = at.model.model.parameters[index].value;
  const double z = space.coordinate(value);
  const double step = space.logarithmic ? kDifference : kDifference * std::max(1.0, std::abs(z));
  return space.value(z + step) <= value ? -step : step;
}

// How the residuals change with one coordinate; zero where the motion leaves all bounds. `run`: the
// one that the coordinate is an initial state of. The others don't depend on it.
void PredictionFitter::difference(const Point& at, std::span<const std::size_t> free,
                                  const VectorXd& weights, double share, Index column,
                                  std::optional<std::size_t> run, MatrixXd& result) const {
  const std::vector<Index> first = first_rows();
  VectorXd step = VectorXd::Zero(result.cols());
  double size = share * difference_step(at, free, column);
  for (int trial = 0; trial < 2; ++trial, size *= -0.1) {
    step(column) = size;
    Point beside = moved(at, free, step);
    if (!run) {
      if (!evaluate(beside, weights)) continue;
      result.col(column) = (beside.residuals - at.residuals) / size;
      return;
    }
    Runner runner = runner_of(beside.model);
    const Index rows = first[*run + 1] - first[*run];
    VectorXd residuals(rows);
    if (!run_one(*run, beside.model, beside.initials, beside.gain, false, runner)) continue;
    weigh(*run, runner.errors, weights, residuals);
    if (!residuals.allFinite()) continue;
    result.col(column).segment(first[*run], rows) =
        (residuals - at.residuals.segment(first[*run], rows)) / size;
    return;
  }
}

MatrixXd PredictionFitter::jacobian(const Point& at, std::span<const std::size_t> free,
                                    const VectorXd& weights, double share) const {
  std::vector<std::optional<std::size_t>> runs(free.size());  // by column
  for (std::size_t r = 0; initial_columns(at) > 0 && r < at.initials.size(); ++r) {
    runs.insert(runs.end(), static_cast<std::size_t>(at.initials[r].size()), r);
  }
  const auto columns = std::ssize(runs);
  MatrixXd result = MatrixXd::Zero(at.residuals.size(), columns);
#pragma omp parallel for num_threads(threads_) schedule(dynamic) if (threads_ > 1)
  for (Index c = 0; c < columns; ++c) {
    difference(at, free, weights, share, c, runs[static_cast<std::size_t>(c)], result);
  }
  return result;
}

std::vector<Index> PredictionFitter::active_columns(const Point& at, const VectorXd& slope,
                                                    PredictionFit& result) const {
  std::vector<Index> active;
  result.at_bound.assign(result.free.size(), false);
  for (Index c = 0; c < slope.size(); ++c) {
    const auto i = static_cast<std::size_t>(c);
    if (i < result.free.size()) {
      result.at_bound[i] = wants_out(at.model.space[result.free[i]],
                                     at.model.model.parameters[result.free[i]].value, slope(c));
    }
    if (i >= result.free.size() || !result.at_bound[i]) active.push_back(c);
  }
  return active;
}

bool PredictionFitter::descend(Point& at, const MatrixXd& jacobian, std::span<const Index> active,
                               std::span<const std::size_t> free, const VectorXd& weights,
                               double& damping) const {
  const MatrixXd normal = jacobian.transpose() * jacobian;
  const VectorXd slope = jacobian.transpose() * at.residuals;
  for (int trial = 0; trial < kTrials; ++trial, damping *= 6.0) {
    MatrixXd damped = normal(active, active);
    const double floor = 1e-12 * damped.diagonal().maxCoeff() + 1e-300;
    damped.diagonal() += damping * (damped.diagonal().array() + floor).matrix();
    VectorXd step = VectorXd::Zero(slope.size());
    step(active) = -damped.ldlt().solve(slope(active));
    if (!step.allFinite()) continue;
    Point next = moved(at, free, step);
    if (!evaluate(next, weights) || !(next.cost < at.cost)) continue;
    at = std::move(next);
    damping = std::max(damping / 6.0, kLeastDamping);
    return true;
  }
  return false;
}

// A residual that jumps within one step stands out from what two other steps say.
PredictionFit PredictionFitter::with_steady_slopes(const PredictionFit& fit,
                                                   const VectorXd& weights) const {
  PredictionFit result = fit;
  Point at{fit.model, fit.initials, fit.gain, 0.0, {}};
  if (!evaluate(at, weights)) return result;
  const MatrixXd backward = jacobian(at, fit.free, weights, -1.0),
                 wider = jacobian(at, fit.free, weights, 5.0);
  for (Index i = 0; i < result.jacobian.size(); ++i) {
    const double a = fit.jacobian.data()[i], b = backward.data()[i], c = wider.data()[i];
    result.jacobian.data()[i] = std::max(std::min(a, b), std::min(std::max(a, b), c));  // median
  }
  return result;
}

PredictionFit PredictionFitter::fit(const ExtendedLumpedModel& start, const VectorXd& weights,
                                    const InitialStates& initials, int iterations,
                                    bool parameters_too) const {
  return fit_from({start,
                   initials.empty() ? measured_initials(start.model) : initials,
                   gain_of(start),
                   0.0,
                   {}},
                  weights, iterations, parameters_too);
}

PredictionFit PredictionFitter::fit_on(const PredictionFit& from, const VectorXd& weights,
                                       int iterations) const {
  return fit_from({from.model, from.initials, from.gain, 0.0, {}}, weights, iterations, true);
}

PredictionFit PredictionFitter::fit_from(Point at, const VectorXd& weights, int iterations,
                                         bool parameters_too) const {
  PredictionFit result;
  if (parameters_too) result.free = at.model.free_parameters();
  result.usable = evaluate(at, weights);
  double damping = kInitialDamping;
  int settled = 0;
  bool is_central = false;
  for (int iteration = 0; result.usable; ++iteration) {
    stop_if_requested();
    const double least = least_fall(at.residuals, data_->output_count(), task_->is_free());
    result.jacobian = jacobian(at, result.free, weights);
    if (settled == kSettledTwice && !is_central && task_->is_free()) {
      is_central = true;
      settled = 0;
      damping = kInitialDamping;
    }
    if (is_central) {
      result.jacobian = 0.5 * (result.jacobian + jacobian(at, result.free, weights, -1.0));
    }
    const std::vector<Index> active =
        active_columns(at, result.jacobian.transpose() * at.residuals, result);
    if (iteration == iterations || settled == kSettledTwice || active.empty()) break;
    const double before = at.cost;
    const bool falls = descend(at, result.jacobian, active, result.free, weights, damping);
    if (falls && before - at.cost >= least * before) {
      settled = 0;
    } else {
      settled = falls ? settled + 1 : kSettledTwice;
    }
  }
  result.model = at.model;
  result.initials = at.initials;
  result.gain = at.gain;
  result.edges = task_->edges(data_->output_count());
  result.fine_edges = task_->edges(data_->output_count(), kFineBlocks);
  if (!result.usable) return result;
  result.cost = at.cost;
  result.residuals = std::move(at.residuals);
  return result;
}

}  // namespace graybox
