#include "diagnosis/predictor/prediction_data.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/predictor/drive_start.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Eigen::Index;

constexpr Index kFewestSeen = 20, kMostSeen = 100;  // before the first forecast
constexpr Index kSeenOfShort = 4;      // of a short recording, which begins with a step
constexpr Index kFewestCounted = 10;   // windows
constexpr double kLeastNoise = 1e-7;   // of an output's scale
constexpr double kLargestPhase = 0.5;  // rad a step, of the fastest mode of the stated model
constexpr int kMostSteps = 16;
constexpr double kThinnedPhase = 0.3;  // rad a thinned sample

// Windows that stand from their first sample to their last.
void mark_standing(const std::vector<std::uint8_t>& standing, PredictionRun& run) {
  if (standing.empty()) return;
  for (Index from = run.first; from < run.samples; from += run.horizon) {
    const Index to = std::min(from + run.horizon, run.samples);
    const bool stands = std::all_of(standing.begin() + from, standing.begin() + to,
                                    [](std::uint8_t flag) { return flag != 0; });
    run.standing.push_back(stands ? 1 : 0);
  }
}

Index seen_before(Index horizon, Index samples) {
  const Index fewest = std::clamp(samples / 10, kSeenOfShort, kFewestSeen);
  return std::max(std::clamp(horizon / 3, fewest, kMostSeen), std::min(kMostSeen, samples / 10));
}

// A rest tells the state by itself.
Index seen_at_start(Index rests, Index usual) {
  return rests > 0 ? std::min(usual, std::max(rests, kSeenAtRest)) : usual;
}

// Largest slope of a stated law's force over the deflection within +-`reach`, at rest.
double largest_slope(const Element& part, double reach) {
  constexpr int kSteps = 400;
  const double step = 2.0 * reach / kSteps;
  double largest = 0.0, before = part.law->force(-reach, 0.0, {});
  for (int k = 1; k <= kSteps; ++k) {
    const double force = part.law->force(-reach + k * step, 0.0, {});
    if (std::isfinite(force - before)) largest = std::max(largest, (force - before) / step);
    before = force;
  }
  return largest;
}

// Stiffness of the springs that bend, stops among them, where they are stiffest.
Eigen::MatrixXd steepest_stiffness(const LumpedModel& model, double reach) {
  Eigen::MatrixXd stiffness = model.stiffness;
  for (const Element& part : model.parts) {
    const Location& place = part.location;
    const bool is_force = place.kind == LocationKind::kElement && place.input == place.output &&
                          place.driver < 0 && part.law && part.law->state_count() == 0;
    const bool is_linear = part.law_name == "stiffness" || part.law_name == "viscous";
    if (!is_force || is_linear || !(reach > 0.0)) continue;
    stiffness += largest_slope(part, reach) * place.output * place.output.transpose();
  }
  return stiffness;
}

// The derivative of this order of a signal, by differences over as many samples as make it stand
// out from noise; empty where none does.
Eigen::VectorXd clear_rate(const Eigen::VectorXd& values, int order, double noise,
                           double sample_time) {
  constexpr double kClear = 10.0;
  const double amplification = order == 2 ? std::sqrt(6.0) : order == 1 ? std::sqrt(2.0) : 1.0;
  for (Index lag = 1; (order + 1) * lag < values.size() / 2; lag *= 2) {
    Eigen::VectorXd rate = values;
    for (int k = 0; k < order; ++k) {
      rate = (rate.tail(rate.size() - lag) - rate.head(rate.size() - lag)).eval();
    }
    const double size = std::sqrt(rate.squaredNorm() / static_cast<double>(rate.size()));
    if (size > kClear * amplification * noise) {
      return rate / std::pow(static_cast<double>(lag) * sample_time, order);
    }
    if (order == 0) break;
  }
  return {};
}

// Where no rate stands out from noise: what deviates from the mean takes the whole recording.
Eigen::VectorXd rate_in_all(const Eigen::VectorXd& values, int order, double sample_time) {
  const double duration = sample_time * static_cast<double>(values.size());
  return (values.array() - (order == 0 ? 0.0 : values.mean())) / std::pow(duration, order);
}

// The largest position that was recorded.
double reach_of(const LumpedModel& model, std::span<const OutputErrorRecording> recordings) {
  double reach = 0.0;
  for (std::size_t j = 0; j < model.outputs.size(); ++j) {
    if (model.outputs[j].quantity != LumpedOutput::Quantity::kPosition) continue;
    for (const OutputErrorRecording& recording : recordings) {
      const auto& values = recording.outputs.col(static_cast<Index>(j));
      reach = std::max(reach, values.cwiseAbs().maxCoeff());
    }
  }
  return reach;
}

// rad/s of the fastest mode, as stated.
double fastest_mode(const LumpedModel& model, std::span<const OutputErrorRecording> recordings) {
  std::vector<Index> free;
  for (std::size_t i = 0; i < model.imposed.size(); ++i) {
    if (!model.imposed[i]) free.push_back(static_cast<Index>(i));
  }
  if (free.empty()) return 0.0;
  const Eigen::MatrixXd inverse = Eigen::MatrixXd(model.mass(free, free)).inverse();
  const Eigen::MatrixXd k =
      inverse * steepest_stiffness(model, reach_of(model, recordings))(free, free);
  const Eigen::MatrixXd c = inverse * model.damping(free, free);
  return std::max(std::sqrt(k.eigenvalues().cwiseAbs().maxCoeff()),
                  c.eigenvalues().cwiseAbs().maxCoeff());
}

double sample_time_of(const OutputErrorRecording& recording) {
  return (recording.time(recording.time.size() - 1) - recording.time(0)) /
         static_cast<double>(recording.time.size() - 1);
}

// The least change of a reading that is rounded; 0: it is not.
double encoder_step(const Eigen::Ref<const Eigen::VectorXd>& values) {
  constexpr double kRepeats = 0.2;  // of the samples do not change
  double least = std::numeric_limits<double>::infinity(), same = 0.0;
  const double size = values.cwiseAbs().maxCoeff();
  for (Index k = 1; k < values.size(); ++k) {
    const double change = std::abs(values(k) - values(k - 1));
    if (change <= 1e-9 * size) {
      same += 1.0;
    } else {
      least = std::min(least, change);
    }
  }
  return same >= kRepeats * static_cast<double>(values.size()) && std::isfinite(least) ? least
                                                                                       : 0.0;
}

// Over each `factor` samples from one on, as the inputs are held, or go evenly, between them.
Eigen::MatrixXd block_means(const Eigen::MatrixXd& values, InputHold hold, Index factor) {
  const Index count = values.rows() / factor;
  Eigen::MatrixXd means(count, values.cols());
  for (Index k = 0; k < count; ++k) {
    const Index first = k * factor, next = std::min(first + factor, values.rows() - 1);
    means.row(k) = values.middleRows(first, factor).colwise().mean();
    if (hold != InputHold::kFirst) continue;
    means.row(k) += (values.row(next) - values.row(first)) / (2.0 * static_cast<double>(factor));
  }
  return means;
}

// The past inputs' means, over blocks that end where the recording begins.
Eigen::MatrixXd past_means(const OutputErrorRecording& recording, InputHold hold, Index factor) {
  const Index count = recording.past_inputs.rows() / factor;
  if (count == 0) return {};
  return block_means(recording.past_inputs.bottomRows(count * factor), hold, factor);
}

// Whether the inputs change within `factor` samples by at most `most` of their rms.
bool changes_slowly(const OutputErrorData& data, Index factor, double most) {
  double dropped = 0.0, all = 0.0;
  for (const OutputErrorRecording& recording : data.recordings) {
    const Eigen::MatrixXd means = block_means(recording.inputs, data.hold, factor);
    for (Index k = 0; k < means.rows() * factor; ++k) {
      dropped += (recording.inputs.row(k) - means.row(k / factor)).squaredNorm();
      all += recording.inputs.row(k).squaredNorm();
    }
  }
  return dropped <= most * most * all;
}

void thin(Index factor, InputHold hold, OutputErrorRecording& recording) {
  const Index count = recording.outputs.rows() / factor;
  recording.past_inputs = past_means(recording, hold, factor);
  recording.inputs = block_means(recording.inputs, hold, factor);
  recording.outputs =
      Eigen::MatrixXd(recording.outputs(Eigen::seqN(0, count, factor), Eigen::indexing::all));
  recording.time = Eigen::VectorXd(recording.time(Eigen::seqN(0, count, factor)));
}

// The first of the estimation recordings' samples.
void cut(Index most, OutputErrorData& data) {
  Index left = most;
  std::erase_if(data.recordings, [&](OutputErrorRecording& recording) {
    if (recording.role != ExperimentRole::kEstimation) return false;
    if (left < std::min<Index>(most / 10, recording.time.size())) return true;
    const Index count = std::min(left, recording.time.size());
    recording.inputs.conservativeResize(count, Eigen::NoChange);
    recording.outputs.conservativeResize(count, Eigen::NoChange);
    recording.time.conservativeResize(count);
    left -= count;
    return false;
  });
}

// The means are held from one thinned sample to the next.
OutputErrorData reduced(const LumpedModel& model, OutputErrorData data, const SampleLimit& limit) {
  const Index most = limit.most;
  Index samples = 0;
  for (const OutputErrorRecording& recording : data.recordings) {
    if (recording.role == ExperimentRole::kEstimation) samples += recording.time.size();
  }
  if (most == 0 || samples <= most) return data;
  const double phase =
      fastest_mode(model, data.recordings) * sample_time_of(data.recordings.front());
  const bool may_thin = data.hold != InputHold::kBandLimited && !model.has_imposed_motion();
  for (Index factor = may_thin ? (samples + most - 1) / most : 1; factor > 1; --factor) {
    const bool may = phase * static_cast<double>(factor) < kThinnedPhase &&
                     changes_slowly(data, factor, limit.dropped);
    if (!may) continue;
    for (OutputErrorRecording& recording : data.recordings) thin(factor, data.hold, recording);
    data.hold = InputHold::kZero;
    data.thinned_by *= factor;
    break;
  }
  if (limit.may_cut) cut(most, data);
  return data;
}

OutputErrorData even_data(const LumpedModel& model, const Campaign& campaign) {
  OutputErrorData data = load_output_error_data(model, campaign);
  for (const OutputErrorRecording& recording : data.recordings) {
    if (recording.even) continue;
    throw InputError(
        fmt::format("{}: sample_time: a diagnosis by prediction error needs even samples; {} has "
                    "irregular times: resample it first",
                    campaign.file.string(), recording.name));
  }
  return data;
}

}  // namespace

double noise_by_differences(const Eigen::Ref<const Eigen::VectorXd>& values) {
  constexpr int kHighest = 8;
  Eigen::VectorXd difference = values;
  double least = std::numeric_limits<double>::infinity(), binomial = 1.0;
  for (int m = 1; m <= kHighest && difference.size() > 2; ++m) {
    difference =
        (difference.tail(difference.size() - 1) - difference.head(difference.size() - 1)).eval();
    binomial *= 2.0 * (2.0 * m - 1.0) / m;  // binomial(2 m, m)
    if (m == 1) continue;
    least = std::min(least, std::sqrt(difference.array().square().mean() / binomial));
  }
  return std::isfinite(least) ? least : 0.0;
}

std::vector<std::uint8_t> standing_samples(const LumpedModel& model, const Eigen::MatrixXd& outputs,
                                           const Eigen::VectorXd& noise) {
  constexpr Index kFewest = 30;
  constexpr double kPositionNoises = 4.0, kVelocityNoises = 3.0;
  std::vector<Index> positions, velocities;
  for (std::size_t j = 0; j < model.outputs.size(); ++j) {
    using enum LumpedOutput::Quantity;
    if (model.imposed[static_cast<std::size_t>(model.outputs[j].mass)]) continue;
    const auto at = static_cast<Index>(j);
    if (model.outputs[j].quantity == kPosition) positions.push_back(at);
    if (model.outputs[j].quantity == kVelocity) velocities.push_back(at);
  }
  if (positions.empty() && velocities.empty()) return {};
  const Index samples = outputs.rows();
  std::vector<std::uint8_t> standing(static_cast<std::size_t>(samples), 0);
  std::vector<double> bands;
  for (const Index j : positions) {
    bands.push_back(std::max(1.01 * encoder_step(outputs.col(j)), kPositionNoises * noise(j)));
  }
  Eigen::VectorXd low(outputs.cols()), high(outputs.cols());
  Index from = 0;
  const auto end_at = [&](Index to) {  // of a stretch
    if (to - from >= kFewest) std::fill(standing.begin() + from, standing.begin() + to, 1);
  };
  for (Index k = 0; k < samples; ++k) {
    const bool turns = std::ranges::all_of(
        velocities, [&](Index j) { return std::abs(outputs(k, j)) <= kVelocityNoises * noise(j); });
    if (k == from) low = high = outputs.row(k).transpose();
    low = low.cwiseMin(outputs.row(k).transpose());
    high = high.cwiseMax(outputs.row(k).transpose());
    bool holds = turns;
    for (std::size_t p = 0; p < positions.size(); ++p) {
      holds &= high(positions[p]) - low(positions[p]) <= bands[p];
    }
    if (holds) continue;
    end_at(k);
    from = turns ? k : k + 1;
    if (turns) low = high = outputs.row(k).transpose();
  }
  end_at(samples);
  return standing;
}

Index PredictionRun::counted() const {
  Index count = 0;
  for (Index k = first; k < samples; ++k) count += counts(k) ? 1 : 0;
  return count;
}

Index PredictionTask::counted() const {
  Index count = 0;
  for (const PredictionRun& run : runs) count += run.counted();
  return count;
}

Index PredictionTask::rows(Index outputs) const {
  Index count = 0;
  for (const PredictionRun& run : runs) count += run.samples * outputs;
  return count;
}

BlockEdges PredictionTask::edges(Index outputs, Index most_blocks) const {
  std::vector<Index> starts;
  const Index whole = rows(1);
  const Index length = is_free() ? std::max<Index>(whole / most_blocks, 1) : horizon;
  Index first = 0;
  for (const PredictionRun& run : runs) {
    for (Index k = run.first; k + length / 2 < run.samples; k += length) {
      if (run.counts(k)) starts.push_back((first + k) * outputs);
    }
    first += run.samples;
  }
  if (starts.empty()) starts.push_back(0);
  starts.front() = 0;
  return block_edges(starts, whole * outputs, most_blocks);
}

PredictionData::PredictionData(const LumpedModel& model, const Campaign& campaign, int threads,
                               const SampleLimit& limit)
    : PredictionData(model, reduced(model, even_data(model, campaign), limit), threads) {}

PredictionData PredictionData::for_model(const LumpedModel& model, int threads,
                                         const SampleLimit& limit) const {
  return {model, reduced(model, problem_.data(), limit), threads};
}

PredictionData PredictionData::with_factors(const LumpedModel& model,
                                            const Eigen::VectorXd& factors, int threads) const {
  OutputErrorData data = problem_.data();
  data.noise.array() *= factors.array().abs();
  for (OutputErrorRecording& recording : data.recordings) {
    recording.outputs *= factors.asDiagonal();
  }
  return {model, std::move(data), threads};
}

PredictionData::PredictionData(const LumpedModel& model, OutputErrorData data, int threads)
    : problem_(model, std::move(data), threads) {
  constexpr double kTwice = 2.0;
  sample_time_ = sample_time_of(problem_.data().recordings.front());
  const double phase = fastest_mode(model, recordings()) * sample_time_;
  steps_ = std::clamp(static_cast<int>(std::ceil(phase / kLargestPhase)),
                      hold() == InputHold::kBandLimited ? 2 : 1, kMostSteps);
  nodes_ = recorded_nodes(recordings(), hold(), steps_);
  estimate_noise();
  for (std::size_t j = 0; j < model.outputs.size(); ++j) {
    double step = 0.0;
    for (const OutputErrorRecording& recording : recordings()) {
      step = std::max(step, encoder_step(recording.outputs.col(static_cast<Index>(j))));
    }
    steps_of_outputs_.push_back(step);
    rounded_.push_back(step > 0.0 ||
                       model.outputs[j].quantity == LumpedOutput::Quantity::kPosition);
  }
  for (std::size_t r = 0; r < recording_count(); ++r) {
    standing_.push_back(standing_samples(model, recording(r).outputs, noise_));
    const bool is_short = recording(r).time.size() < kShortRecording;
    const Index at_start =
        std::max(samples_at_rest(model, recording(r)), samples_at_one_speed(model, recording(r)));
    rests_at_start_.push_back(is_short ? at_start : 0);
    const Eigen::VectorXd initial = measured_initial(r);
    largest_first_speeds_.push_back(rests_at_start_.back() > 0
                                        ? kTwice * std::abs(initial(initial.size() - 1))
                                        : std::numeric_limits<double>::infinity());
  }
  measure_force(model);
}

void PredictionData::estimate_noise() {
  noise_ = problem_.data().noise;
  for (Index j = 0; j < noise_.size(); ++j) {
    double least = std::numeric_limits<double>::infinity();
    for (const OutputErrorRecording& recording : recordings()) {
      if (recording.role == ExperimentRole::kEstimation) {
        least = std::min(least, noise_by_differences(recording.outputs.col(j)));
      }
    }
    stated_.push_back(noise_(j) > 0.0);
    if (!stated_.back()) noise_(j) = least;
    noise_(j) = std::max({noise_(j), kLeastNoise * output_scale()(j), 1e-300});
  }
}

void PredictionData::limit_noise(const Eigen::VectorXd& most) {
  for (Index j = 0; j < noise_.size(); ++j) {
    if (states_noise(j)) continue;
    const double least = std::max(kLeastNoise * output_scale()(j), 1e-300);
    noise_(j) = std::min(noise_(j), std::max(most(j), least));
  }
}

// What moves the masses where no force is recorded: mass times the acceleration that an output
// shows.
void PredictionData::measure_inertial_force(const LumpedModel& model) {
  double squares = 0.0;
  for (std::size_t j = 0; j < model.outputs.size(); ++j) {
    const LumpedOutput& output = model.outputs[j];
    if (output.quantity == LumpedOutput::Quantity::kForce) continue;
    const int order = output.quantity == LumpedOutput::Quantity::kPosition   ? 2
                      : output.quantity == LumpedOutput::Quantity::kVelocity ? 1
                                                                             : 0;
    const double mass = model.masses(output.mass);
    double own = 0.0, samples = 0.0, faint = 0.0;
    for (const OutputErrorRecording& recording : recordings()) {
      const auto values = recording.outputs.col(static_cast<Index>(j));
      const Eigen::VectorXd rate =
          clear_rate(values, order, noise_(static_cast<Index>(j)), sample_time_);
      faint = std::max(faint, rate_in_all(values, order, sample_time_).squaredNorm() /
                                  static_cast<double>(values.size()));
      if (rate.size() == 0) continue;
      own += (mass * rate).squaredNorm();
      samples += static_cast<double>(rate.size());
      largest_force_ = std::fmax(largest_force_, mass * rate.cwiseAbs().maxCoeff());
    }
    squares = std::max(squares, samples > 0.0 ? own / samples : mass * mass * faint);
  }
  if (squares > 0.0) force_scale_ = std::sqrt(squares);
}

void PredictionData::measure_force(const LumpedModel& model) {
  double squares = 0.0, samples = 0.0, largest = 0.0;
  const auto add = [&](const Eigen::MatrixXd& values, Index channel) {
    squares += values.col(channel).squaredNorm();
    largest = std::max(largest, values.col(channel).cwiseAbs().maxCoeff());
    samples += static_cast<double>(values.rows());
  };
  for (const OutputErrorRecording& recording : recordings()) {
    for (std::size_t j = 0; j < model.inputs.size(); ++j) {
      if (model.inputs[j].kind == LumpedInput::Kind::kForce) {
        add(recording.inputs, static_cast<Index>(j));
      }
    }
    for (std::size_t j = 0; j < model.outputs.size(); ++j) {
      if (model.outputs[j].quantity == LumpedOutput::Quantity::kForce) {
        add(recording.outputs, static_cast<Index>(j));
      }
    }
  }
  if (squares > 0.0) {
    force_scale_ = std::sqrt(squares / samples);
    largest_force_ = largest;
  } else {
    moves_freely_ = !model.has_imposed_motion();
    measure_inertial_force(model);
  }
}

Eigen::VectorXd PredictionData::measured_initial(std::size_t index) const {
  return problem_.measured_initial({index, {0, recording(index).time.size()}});
}

Index PredictionData::shortest() const {
  Index least = std::numeric_limits<Index>::max();
  for (const OutputErrorRecording& recording : recordings()) {
    if (recording.role == ExperimentRole::kEstimation) {
      least = std::min(least, recording.time.size());
    }
  }
  return least;
}

bool PredictionData::has_validation() const {
  return std::ranges::any_of(recordings(), [](const OutputErrorRecording& recording) {
    return recording.role == ExperimentRole::kValidation;
  });
}

Index whole_windows(Index samples, Index horizon) {
  return std::max<Index>(samples - seen_before(horizon, samples), 0) / horizon;
}

Index PredictionData::window_count(Index horizon) const {
  Index count = 0;
  for (const OutputErrorRecording& recording : recordings()) {
    if (recording.role != ExperimentRole::kEstimation) continue;
    count += whole_windows(recording.time.size(), horizon);
  }
  return count;
}

Index PredictionData::first_horizon() const {
  Index horizon = kFirstHorizon;
  while (horizon > kShortestHorizon && window_count(horizon) < kFewestHorizonWindows) --horizon;
  return horizon;
}

PredictionTask PredictionData::free_after_start(ExperimentRole role) const {
  const Index seen = std::max<Index>(1, kSeenBeforeFreeRun / problem_.data().thinned_by);
  PredictionTask task = windows(0, role);
  for (PredictionRun& run : task.runs) {
    task.horizon = std::max(task.horizon, run.samples);
    run.first = std::min(seen_at_start(rests_at_start_[run.recording], seen), run.samples / 2);
    run.horizon = run.samples - run.first;
  }
  return task;
}

PredictionTask PredictionData::windows(Index horizon, ExperimentRole role) const {
  PredictionTask task{horizon, {}};
  for (std::size_t r = 0; r < recording_count(); ++r) {
    if (recording(r).role != role) continue;
    PredictionRun run{r, recording(r).time.size(), 0, 0, {}};
    if (horizon > 0) {
      run.first = seen_at_start(rests_at_start_[r], seen_before(horizon, run.samples));
      run.horizon = horizon;
      mark_standing(standing_[r], run);
    }
    task.runs.push_back(std::move(run));
  }
  if (horizon > 0 && task.counted() < kFewestCounted * horizon) {  // it hardly ever moves
    for (PredictionRun& run : task.runs) run.standing.clear();
  }
  return task;
}

double PredictionData::growth_of_inputs() const {
  Eigen::VectorXd squares[2], samples[2];
  for (const OutputErrorRecording& recording : recordings()) {
    const int role = recording.role == ExperimentRole::kEstimation ? 0 : 1;
    const Eigen::VectorXd own = recording.inputs.colwise().squaredNorm().transpose();
    if (squares[role].size() == 0)
      squares[role] = samples[role] = Eigen::VectorXd::Zero(own.size());
    squares[role] += own;
    samples[role].array() += static_cast<double>(recording.inputs.rows());
  }
  double most = 0.0;
  for (Eigen::Index j = 0; j < std::min(squares[0].size(), squares[1].size()); ++j) {
    const double of_fit = squares[0](j) / samples[0](j), kept_out = squares[1](j) / samples[1](j);
    if (of_fit > 0.0) most = std::max(most, std::sqrt(kept_out / of_fit));
  }
  return most;
}

}  // namespace graybox
