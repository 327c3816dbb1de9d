#include "diagnosis/output_error/output_error_problem.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/output_error/output_delay.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kFewestSamples = 10;

Eigen::Index channel(const ExperimentRecording& run, const std::string& source,
                     const std::string& name, const std::string& unit, const char* noun) {
  const auto& signals = run.data.signals;
  const auto found = std::ranges::find(signals, name, &Signal::name);
  if (found == signals.end()) {
    std::vector<std::string> names;
    for (const Signal& signal : signals) names.push_back(signal.name);
    throw InputError(
        fmt::format("{}: channels: none is called '{}' like the model's {}; there are {}", source,
                    name, noun, fmt::join(names, ", ")));
  }
  if (found->unit != unit) {
    throw InputError(
        fmt::format("{}: channels: {} is in {}, but the model's {} in {}: state its gain and unit",
                    source, name, found->unit, noun, unit));
  }
  return found - signals.begin();
}

Eigen::MatrixXd columns(const ExperimentRecording& run, const SignalPiece& piece,
                        const std::string& source, const std::vector<std::string>& names,
                        const std::vector<std::string>& units, const char* noun) {
  Eigen::MatrixXd values(piece.values.rows(), static_cast<Eigen::Index>(names.size()));
  for (std::size_t j = 0; j < names.size(); ++j) {
    values.col(static_cast<Eigen::Index>(j)) =
        piece.values.col(channel(run, source, names[j], units[j], noun));
  }
  return values;
}

void check_hold(const LumpedModel& model, const Campaign& campaign,
                const ExperimentRecording& run) {
  if (campaign.hold == InputHold::kZero && model.has_imposed_motion()) {
    throw InputError(
        fmt::format("{}: hold: an imposed motion does not jump from sample to sample; say first or "
                    "band_limited",
                    campaign.file.string()));
  }
  if (campaign.hold == InputHold::kBandLimited && !run.data.sample_time) {
    throw InputError(fmt::format("{}: hold: band_limited needs even samples; say first",
                                 campaign.file.string()));
  }
}

// A part that goes on where another part of the same files ends knows the inputs before it.
// `experiment`: of each recording.
void join_parts(const Campaign& campaign, std::span<const std::size_t> experiment,
                std::vector<OutputErrorRecording>& recordings) {
  constexpr double kNextSample = 0.01;  // of a sample
  const auto goes_on = [&](std::size_t later, std::size_t earlier) {
    const Eigen::VectorXd& time = recordings[earlier].time;
    const double last = time(time.size() - 1), step = last - time(time.size() - 2);
    return recordings[earlier].even &&
           campaign.experiments[experiment[later]].files ==
               campaign.experiments[experiment[earlier]].files &&
           std::abs(recordings[later].time(0) - last - step) <= kNextSample * step;
  };
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    for (std::size_t j = 0; j < recordings.size(); ++j) {
      if (goes_on(k, j)) recordings[k].past_inputs = recordings[j].inputs;
    }
  }
}

// Rates of imposed motions that no input states, from the parabola through neighbours.
void add_derived_channels(const LumpedSystem& system, OutputErrorRecording& recording) {
  const auto& derived = system.derived_channels();
  if (derived.empty()) return;
  recording.past_inputs.resize(0, 0);
  const Eigen::Index given = recording.inputs.cols();
  recording.inputs.conservativeResize(Eigen::NoChange,
                                      given + static_cast<Eigen::Index>(derived.size()));
  for (std::size_t k = 0; k < derived.size(); ++k) {
    recording.inputs.col(given + static_cast<Eigen::Index>(k)) =
        time_derivative(recording.time, recording.inputs.col(derived[k].of));
  }
}

double standard_deviation(const Eigen::VectorXd& values) {
  return std::sqrt((values.array() - values.mean()).square().mean());
}

// Slope of the straight line through the first samples.
double first_rate(const Eigen::VectorXd& time, const Eigen::VectorXd& values) {
  const Eigen::Index count = std::min<Eigen::Index>(time.size(), 7);
  const Eigen::VectorXd t = time.head(count).array() - time.head(count).mean();
  return t.dot(values.head(count)) / t.squaredNorm();
}

}  // namespace

OutputErrorData load_output_error_data(const LumpedModel& model, const Campaign& campaign) {
  OutputErrorData data;
  data.hold = campaign.hold;
  data.noise = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(model.output_names.size()));
  const std::string source = campaign.file.string();
  std::vector<std::size_t> experiment;
  for (std::size_t k = 0; k < campaign.experiments.size(); ++k) {
    const ExperimentRecording run = load_experiment(campaign, k);
    check_hold(model, campaign, run);
    for (const std::string& remark : run.data.remarks) {
      data.remarks.push_back(fmt::format("{}: {}", campaign.experiments[k].name, remark));
    }
    for (const SignalPiece& piece : run.data.pieces) {
      if (piece.time.size() < kFewestSamples) {
        throw InputError(fmt::format("{}: {} has a segment of {} samples; a fit needs {}", source,
                                     campaign.experiments[k].name, piece.time.size(),
                                     kFewestSamples));
      }
      experiment.push_back(k);
      data.recordings.push_back(
          {.name = campaign.experiments[k].name,
           .role = campaign.experiments[k].role,
           .time = piece.time,
           .even = run.data.sample_time.has_value(),
           .inputs = columns(run, piece, source, model.input_names, model.input_units, "input"),
           .outputs =
               columns(run, piece, source, model.output_names, model.output_units, "output")});
    }
  }
  join_parts(campaign, experiment, data.recordings);
  for (const Channel& channel : campaign.channels) {
    const auto found = std::ranges::find(model.output_names, channel.name);
    if (found != model.output_names.end()) {
      data.noise(found - model.output_names.begin()) = channel.noise;
    }
  }
  return data;
}

OutputErrorProblem::OutputErrorProblem(LumpedModel model, OutputErrorData data, int threads)
    : model_(std::move(model)), data_(std::move(data)), threads_(threads) {
  for (std::size_t i = 0; i < model_.parameters.size(); ++i) {
    if (!model_.parameters[i].fixed) free_.push_back(i);
  }
  for (const Element& part : model_.parts) {
    const bool at_input = part.location.kind == LocationKind::kActuator;
    if (part.use == LawUse::kDelay && at_input) delays_vary_ = true;
  }
  LumpedSystem system(model_, {}, 0);
  initial_size_ = 2 * system.coordinate_count();
  std::vector<double> all;
  output_scale_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(model_.outputs.size()));
  Eigen::Index samples = 0;
  for (OutputErrorRecording& recording : data_.recordings) {
    even_ = even_ && recording.even;
    add_derived_channels(system, recording);
    if (recording.role != ExperimentRole::kEstimation) continue;
    samples += recording.time.size();
    for (Eigen::Index j = 0; j < output_scale_.size(); ++j) {
      const double deviation = standard_deviation(recording.outputs.col(j));
      output_scale_(j) += deviation * deviation * static_cast<double>(recording.time.size());
    }
  }
  if (samples == 0) throw InputError("the campaign has no experiment for estimation");
  output_scale_ = (output_scale_ / static_cast<double>(samples)).cwiseSqrt();
  set_steps_per_sample(data_.hold == InputHold::kBandLimited ? 2 : 1);
}

Eigen::VectorXd OutputErrorProblem::start() const {
  Eigen::VectorXd theta(static_cast<Eigen::Index>(free_.size()));
  for (std::size_t i = 0; i < free_.size(); ++i) {
    theta(static_cast<Eigen::Index>(i)) = model_.parameters[free_[i]].value;
  }
  return theta;
}

LumpedModel OutputErrorProblem::model_at(const Eigen::VectorXd& theta) const {
  std::vector<double> values;
  for (const LumpedParameter& parameter : model_.parameters) values.push_back(parameter.value);
  for (std::size_t i = 0; i < free_.size(); ++i) {
    values[free_[i]] = theta(static_cast<Eigen::Index>(i));
  }
  return with_parameters(model_, values);
}

Eigen::MatrixXd OutputErrorRecording::inputs_with_past() const {
  Eigen::MatrixXd all(past_inputs.rows() + inputs.rows(), inputs.cols());
  if (past_inputs.rows() > 0) all.topRows(past_inputs.rows()) = past_inputs;
  all.bottomRows(inputs.rows()) = inputs;
  return all;
}

NodeInputs OutputErrorProblem::nodes_of(std::size_t recording, const LumpedSystem& system,
                                        int steps) const {
  const OutputErrorRecording& run = data_.recordings[recording];
  Eigen::VectorXd delays = Eigen::VectorXd::Zero(run.inputs.cols());
  const double sample_time =
      (run.time(run.time.size() - 1) - run.time(0)) / static_cast<double>(run.time.size() - 1);
  delays.head(system.input_delays().size()) = system.input_delays() / sample_time;
  NodeInputs nodes =
      node_inputs(run.inputs_with_past(), data_.hold, steps, delays, system.has_free_delay());
  nodes.drop_samples(run.past_inputs.rows());
  // The derivatives are by the delay in seconds.
  nodes.slopes /= sample_time;
  nodes.sample_slopes /= sample_time;
  return nodes;
}

void OutputErrorProblem::set_steps_per_sample(int steps) {
  steps_ = steps;
  nodes_.clear();
  if (delays_vary_) return;
  const LumpedSystem system(model_, {}, 0);
  for (std::size_t k = 0; k < data_.recordings.size(); ++k) {
    nodes_.push_back(nodes_of(k, system, steps));
  }
}

std::vector<StretchOf> OutputErrorProblem::whole_recordings(ExperimentRole role) const {
  std::vector<StretchOf> stretches;
  for (std::size_t k = 0; k < data_.recordings.size(); ++k) {
    if (data_.recordings[k].role != role) continue;
    stretches.push_back({k, {0, data_.recordings[k].time.size()}});
  }
  return stretches;
}

std::vector<StretchOf> OutputErrorProblem::windows(Eigen::Index samples, Eigen::Index total) const {
  Eigen::Index available = 0;
  const auto whole = whole_recordings(ExperimentRole::kEstimation);
  for (const StretchOf& stretch : whole) available += stretch.stretch.count;
  const Eigen::Index every = std::max<Eigen::Index>(1, available / std::max(total, samples));
  std::vector<StretchOf> stretches;
  Eigen::Index number = 0;
  for (const StretchOf& stretch : whole) {
    const Eigen::Index length = std::min(samples, stretch.stretch.count);
    for (Eigen::Index first = 0; first + length <= stretch.stretch.count; first += length) {
      if (number++ % every == 0) stretches.push_back({stretch.recording, {first, length}});
    }
  }
  return stretches;
}

Eigen::VectorXd OutputErrorProblem::measured_initial(const StretchOf& stretch) const {
  const OutputErrorRecording& run = data_.recordings[stretch.recording];
  const Eigen::Index masses = model_.masses.size(), n = initial_size_ / 2;
  Eigen::VectorXd q = Eigen::VectorXd::Zero(masses), v = q;
  std::vector<bool> known(static_cast<std::size_t>(masses), false);
  std::vector<bool> rate_known = known;
  const Eigen::VectorXd time = run.time.segment(stretch.stretch.first, stretch.stretch.count);
  for (std::size_t j = 0; j < model_.outputs.size(); ++j) {
    const LumpedOutput& output = model_.outputs[j];
    const Eigen::VectorXd values = run.outputs.col(static_cast<Eigen::Index>(j))
                                       .segment(stretch.stretch.first, stretch.stretch.count);
    const auto mass = static_cast<std::size_t>(output.mass);
    using enum LumpedOutput::Quantity;
    if (output.quantity == kPosition) {
      q(output.mass) = values(0);
      known[mass] = true;
      if (!rate_known[mass]) v(output.mass) = first_rate(time, values);
      rate_known[mass] = true;
    } else if (output.quantity == kVelocity) {
      v(output.mass) = values(0);
      rate_known[mass] = true;
    }
  }
  // Springs at rest: K_uu x_u = -K_uk x_k, for coordinates that no output shows.
  const auto complete = [&](const std::vector<bool>& is_known, Eigen::VectorXd& x) {
    std::vector<Eigen::Index> unknown;
    for (Eigen::Index i = 0; i < masses; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (!is_known[k] && !model_.imposed[k]) unknown.push_back(i);
    }
    if (unknown.empty()) return;
    const auto count = static_cast<Eigen::Index>(unknown.size());
    const double little = 1e-9 * (model_.stiffness.diagonal().cwiseAbs().maxCoeff() + 1e-300);
    Eigen::MatrixXd k = little * Eigen::MatrixXd::Identity(count, count);
    Eigen::VectorXd pull = -model_.stiffness * x, held(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      held(i) = pull(unknown[static_cast<std::size_t>(i)]);
      for (Eigen::Index j = 0; j < count; ++j) {
        k(i, j) += model_.stiffness(unknown[static_cast<std::size_t>(i)],
                                    unknown[static_cast<std::size_t>(j)]);
      }
    }
    const Eigen::VectorXd solved = k.ldlt().solve(held);
    if (!solved.allFinite()) return;
    for (Eigen::Index i = 0; i < count; ++i) x(unknown[static_cast<std::size_t>(i)]) = solved(i);
  };
  complete(known, q);
  complete(rate_known, v);
  Eigen::VectorXd initial(2 * n);
  Eigen::Index slot = 0;
  for (Eigen::Index i = 0; i < masses; ++i) {
    if (model_.imposed[static_cast<std::size_t>(i)]) continue;
    initial(slot) = q(i);
    initial(n + slot++) = v(i);
  }
  return initial;
}

void OutputErrorProblem::simulate(const Eigen::VectorXd& theta,
                                  std::span<const StretchOf> stretches,
                                  std::span<const Eigen::VectorXd> initial, bool with_derivatives,
                                  std::vector<Simulated>& result) const {
  simulate_with(steps_, delays_vary_ ? nullptr : &nodes_, theta, stretches, initial,
                with_derivatives, result);
}

void OutputErrorProblem::simulate_with(int steps, const std::vector<NodeInputs>* nodes,
                                       const Eigen::VectorXd& theta,
                                       std::span<const StretchOf> stretches,
                                       std::span<const Eigen::VectorXd> initial,
                                       bool with_derivatives,
                                       std::vector<Simulated>& result) const {
  const LumpedModel model = model_at(theta);
  const std::span<const std::size_t> free =
      with_derivatives ? std::span<const std::size_t>(free_) : std::span<const std::size_t>();
  const bool with_initial = !initial.empty();
  const LumpedSystem system(model, free, with_derivatives && with_initial ? initial_size_ : 0);
  std::optional<ExponentialOperators> operators;
  if (even_ && initial_size_ > 0) {
    const OutputErrorRecording& run = data_.recordings.front();
    const double sample_time =
        (run.time(run.time.size() - 1) - run.time(0)) / static_cast<double>(run.time.size() - 1);
    operators = exponential_operators(system.linear_part(), system.linear_part_derivatives(),
                                      sample_time / steps);
  }
  std::vector<NodeInputs> own;
  if (nodes == nullptr) {
    for (std::size_t k = 0; k < data_.recordings.size(); ++k) {
      own.push_back(nodes_of(k, system, steps));
    }
    nodes = &own;
  }
  result.resize(stretches.size());
  const auto count = static_cast<std::ptrdiff_t>(stretches.size());
#pragma omp parallel num_threads(threads_) if (threads_ > 1)
  {
    LumpedSystem workspace = system;
    TrajectoryIntegrator integrator(workspace, operators ? &*operators : nullptr);
#pragma omp for schedule(dynamic)
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      const auto at = static_cast<std::size_t>(k);
      const auto& [recording, stretch] = stretches[at];
      const Eigen::VectorXd& time = data_.recordings[recording].time;
      result[at].finite =
          integrator.run((*nodes)[recording], time, stretch,
                         with_initial ? initial[at] : Eigen::VectorXd(), result[at].outputs);
      if (!result[at].finite) continue;
      delay_outputs(time.segment(stretch.first, stretch.count), system.output_delays(),
                    system.output_delay_columns(), result[at].outputs);
    }
  }
}

double OutputErrorProblem::step_error(const Eigen::VectorXd& theta,
                                      std::span<const StretchOf> stretches,
                                      std::span<const Eigen::VectorXd> initial) const {
  std::vector<Simulated> coarse, fine;
  simulate(theta, stretches, initial, false, coarse);
  std::vector<NodeInputs> nodes;
  simulate_with(2 * steps_, nullptr, theta, stretches, initial, false, fine);
  const auto ny = output_scale_.size();
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(ny);
  Eigen::Index samples = 0;
  for (std::size_t k = 0; k < coarse.size(); ++k) {
    if (!coarse[k].finite || !fine[k].finite) return std::numeric_limits<double>::infinity();
    const Eigen::VectorXd change = (coarse[k].outputs - fine[k].outputs).col(0);
    for (Eigen::Index i = 0; i < change.size(); ++i) squares(i % ny) += change(i) * change(i);
    samples += change.size() / ny;
  }
  return ((squares / static_cast<double>(samples)).cwiseSqrt().cwiseQuotient(output_scale_))
      .maxCoeff();
}

Eigen::VectorXd OutputErrorProblem::measured(const StretchOf& stretch) const {
  const OutputErrorRecording& run = data_.recordings[stretch.recording];
  const Eigen::Index ny = run.outputs.cols();
  Eigen::VectorXd values(stretch.stretch.count * ny);
  for (Eigen::Index k = 0; k < stretch.stretch.count; ++k) {
    values.segment(k * ny, ny) = run.outputs.row(stretch.stretch.first + k).transpose();
  }
  return values;
}

}  // namespace graybox
