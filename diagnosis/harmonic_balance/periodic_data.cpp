#include "diagnosis/harmonic_balance/periodic_data.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <exception>
#include <mutex>
#include <numbers>
#include <optional>

#include "diagnosis/harmonic_balance/noise_whitening.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/responses/covariance_pool.hpp"
#include "diagnosis/responses/estimate_responses.hpp"
#include "diagnosis/signals/line_spectra.hpp"
#include "problems/base/array_index.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct ReadRecord {
  MeasuredRecord record;
  std::vector<std::string> outputs, units;
  std::vector<MatrixXcd> samples;  // of the noise, of lines 0 ... K, outputs then inputs
  std::vector<std::vector<std::size_t>> bins;
};

[[noreturn]] void refuse(const Campaign& campaign, const std::string& message) {
  throw InputError(fmt::format("{}: {}", campaign.file.string(), message));
}

// What all experiments of the campaign must share.
PeriodicExcitation common_excitation(const Campaign& campaign) {
  const Experiment* first = nullptr;
  std::size_t periods = 0;
  for (const Experiment& experiment : campaign.experiments) {
    if (!experiment.excitation) {
      refuse(campaign, fmt::format("experiments: {} states no excitation (period, periods, lines), "
                                   "which a diagnosis of periodic recordings needs",
                                   experiment.name));
    }
    if (first == nullptr) first = &experiment;
    if (experiment.excitation->period != first->excitation->period) {
      refuse(campaign, fmt::format("experiments: {} has another period than {}; diagnose them in "
                                   "campaigns of their own",
                                   experiment.name, first->name));
    }
    periods = std::max(periods, experiment.excitation->periods);
  }
  if (first == nullptr) refuse(campaign, "experiments: there are none");
  PeriodicExcitation common = *first->excitation;
  common.periods = periods;
  for (const Experiment& experiment : campaign.experiments) {
    common.lines.insert(common.lines.end(), experiment.excitation->lines.begin(),
                        experiment.excitation->lines.end());
  }
  std::ranges::sort(common.lines);
  const auto repeated = std::ranges::unique(common.lines);
  common.lines.erase(repeated.begin(), repeated.end());
  if (common.lines.empty()) refuse(campaign, "experiments: excitation: lines: none are excited");
  return common;
}

std::vector<Index> columns_of(const std::vector<Signal>& signals, ChannelRole role) {
  std::vector<Index> columns;
  for (std::size_t c = 0; c < signals.size(); ++c) {
    if (signals[c].role == role) columns.push_back(static_cast<Index>(c));
  }
  return columns;
}

// Bins up to half a line beyond the last.
void keep_bins(const PeriodicData& frame, const MatrixXcd& bins, Index periods, Index outputs,
               MeasuredRecord& record) {
  record.periods = periods;
  if (periods < 2) return;
  const Index last = std::min(periods * frame.last_line + periods / 2, bins.rows() - 1);
  const MatrixXcd scaled =
      bins.topRows(last + 1).transpose() / std::sqrt(static_cast<double>(periods));
  record.output_bins = scaled.topRows(outputs);
  record.input_bins = scaled.bottomRows(scaled.rows() - outputs);
}

// The mean of the periods.
void keep_input_period(const Eigen::Ref<const MatrixXd>& inputs, Index period, Index periods,
                       MeasuredRecord& record) {
  record.input_period = MatrixXd::Zero(inputs.cols(), period);
  for (Index p = 0; p < periods; ++p) {
    record.input_period +=
        inputs.middleRows(p * period, period).transpose() / static_cast<double>(periods);
  }
  record.input.col(0) = std::sqrt(static_cast<double>(period)) *
                        record.input_period.rowwise().mean().cast<std::complex<double>>();
}

// The noise of recordings that were read, and the whitening that makes it white: from the scatter
// between periods, or from what the campaign states where there is one period.
class NoiseWhitener {
 public:
  NoiseWhitener(const Campaign& campaign, const PlantFamily& family,
                const PeriodicDataOptions& options, const std::vector<ReadRecord>& read,
                PeriodicData& data)
      : campaign_(campaign), family_(family), options_(options), read_(read), data_(data) {}

  // Whitening of each group: the recordings of one level.
  void whiten(std::size_t groups) {
    const bool is_repeated = std::ranges::any_of(
        read_, [](const ReadRecord& read) { return read.samples.back().cols() > 0; });
    if (is_repeated) estimate_responses_if_complete();
    for (std::size_t group = 0; group < groups; ++group) {
      data_.whitening.push_back(is_repeated ? estimated_whitening(group) : stated_whitening(group));
    }
  }

 private:
  void estimate_responses_if_complete() {
    ResponseOptions options;
    options.threads = options_.threads;
    try {
      data_.responses = estimate_responses(campaign_, options);
    } catch (const InputError&) {
      data_.responses.clear();  // sub-experiments are missing: the model's responses serve
    }
  }

  [[nodiscard]] MatrixXcd whitened_by(const MatrixXcd& covariance, const VectorXd& level) const {
    const auto whitening = whitening_of(covariance, level, options_.model_accuracy);
    if (!whitening) refuse(campaign_, "an output has neither noise nor signal at some lines");
    return *whitening;
  }

  [[nodiscard]] std::vector<MatrixXcd> stated_whitening(std::size_t group) const {
    VectorXd variance(family_.output_count());
    Index at = 0;
    for (const Channel& channel : campaign_.channels) {
      if (channel.role != ChannelRole::kOutput) continue;
      if (!(channel.noise > 0.0)) {
        refuse(campaign_, fmt::format("channels: {}: with one period recorded the noise must be "
                                      "stated (noise: standard deviation)",
                                      channel.name));
      }
      variance(at++) = channel.noise * channel.noise;
    }
    const MatrixXd level = output_level(data_, group);
    std::vector<MatrixXcd> result(static_cast<std::size_t>(data_.last_line) + 1);
    for (Index k = data_.first_line; k <= data_.last_line; ++k) {
      result[static_cast<std::size_t>(k)] =
          whitened_by(variance.cast<std::complex<double>>().asDiagonal(), level.col(k));
    }
    return result;
  }

  // Lines at which noise is sampled: the excited ones, and beyond them as densely as their last
  // two.
  [[nodiscard]] std::vector<Index> noise_lines() const {
    std::vector<Index> lines(data_.excited.begin(), data_.excited.end());
    const Index step = std::max<Index>(1, data_.last_line / 40);
    for (Index k = lines.back() + step; k <= data_.last_line; k += step) lines.push_back(k);
    if (lines.back() != data_.last_line) lines.push_back(data_.last_line);
    return lines;
  }

  // From recorded inputs to outputs: measured at excited lines, else the model's.
  [[nodiscard]] MatrixXcd response_at(Index line, const MeasuredRecord& record,
                                      std::vector<std::optional<LinearPlant>>& plants) const {
    for (const FrequencyResponseEstimate& estimate : data_.responses) {
      if (estimate.level != record.level || estimate.position != data_.degrees[record.position])
        continue;
      const auto at = std::ranges::find(estimate.lines, static_cast<std::size_t>(line));
      if (at != estimate.lines.end()) {
        return estimate.responses[static_cast<std::size_t>(at - estimate.lines.begin())];
      }
    }
    std::optional<LinearPlant>& plant = plants[record.position];
    if (!plant) {
      const Eigen::VectorXd start = family_.start_values();
      plant = family_.plant(data_.positions[record.position], start, {});
    }
    return sampled_response(*plant, data_.frequencies[static_cast<std::size_t>(line)],
                            data_.sample_time);
  }

  [[nodiscard]] std::vector<MatrixXcd> estimated_whitening(std::size_t group) {
    const std::vector<Index> lines = noise_lines();
    const Index outputs = family_.output_count();
    std::vector<LineScatter> scatter(lines.size());
    std::vector<double> frequencies;
    std::vector<std::optional<LinearPlant>> plants(data_.positions.size());
    for (std::size_t at = 0; at < lines.size(); ++at) {
      const auto line = static_cast<std::size_t>(lines[at]);
      frequencies.push_back(data_.frequencies[line]);
      scatter[at].scatter = MatrixXcd::Zero(outputs, outputs);
      for (const ReadRecord& read : read_) {
        const MatrixXcd& samples = read.samples[line];
        if (read.record.group != group || samples.cols() == 0) continue;
        const MatrixXcd noise =
            samples.topRows(outputs) -
            response_at(lines[at], read.record, plants) * samples.bottomRows(family_.input_count());
        scatter[at].scatter += noise * noise.adjoint();
        scatter[at].degrees_of_freedom += static_cast<double>(noise.cols());
        scatter[at].bins = read.bins[line];
      }
    }
    const auto pooled =
        pool_covariances(scatter, frequencies, wanted_noise_samples(options_, outputs));
    data_.noise_pools.push_back(pool_of(scatter, pooled));
    return interpolated(pooled, lines, frequencies, output_level(data_, group));
  }

  [[nodiscard]] std::vector<MatrixXcd> interpolated(const std::vector<OutputCovariance>& pooled,
                                                    const std::vector<Index>& lines,
                                                    const std::vector<double>& frequencies,
                                                    const MatrixXd& level) const {
    std::vector<MatrixXcd> result(static_cast<std::size_t>(data_.last_line) + 1);
    std::size_t right = 1;
    for (Index k = data_.first_line; k <= data_.last_line; ++k) {
      while (right + 1 < lines.size() && lines[right] < k) ++right;
      const std::size_t left = lines.size() > 1 ? right - 1 : 0;
      const std::size_t other = std::min(right, lines.size() - 1);
      const double w = data_.frequencies[static_cast<std::size_t>(k)];
      const double span = std::log(frequencies[other] / frequencies[left]);
      const double share =
          span > 0.0 ? std::clamp(std::log(w / frequencies[left]) / span, 0.0, 1.0) : 0.0;
      result[static_cast<std::size_t>(k)] =
          whitened_by(between(pooled[left], pooled[other], share), level.col(k));
    }
    return result;
  }

  // Powers interpolate geometrically, as powers of frequency do; their shapes linearly.
  [[nodiscard]] static MatrixXcd between(const OutputCovariance& a, const OutputCovariance& b,
                                         double share) {
    const double power_a = a.covariance.trace().real(), power_b = b.covariance.trace().real();
    if (!(power_a > 0.0) || !(power_b > 0.0)) return a.covariance;
    const MatrixXcd shape = (1.0 - share) * a.covariance / power_a + share * b.covariance / power_b;
    const double samples = (1.0 - share) * a.degrees_of_freedom + share * b.degrees_of_freedom;
    return inverse_bias(samples, shape.rows()) * std::pow(power_a, 1.0 - share) *
           std::pow(power_b, share) * shape;
  }

  const Campaign& campaign_;
  const PlantFamily& family_;
  const PeriodicDataOptions& options_;
  const std::vector<ReadRecord>& read_;
  PeriodicData& data_;
};

class PeriodicReader {
 public:
  PeriodicReader(const Campaign& campaign, const PlantFamily& family,
                 const PeriodicDataOptions& options)
      : campaign_(campaign), family_(family), options_(options) {}

  PeriodicData read() {
    lay_out();
    read_records();
    if (data_.estimation.empty()) refuse(campaign_, "experiments: none is for estimation");
    NoiseWhitener(campaign_, family_, options_, read_, data_).whiten(levels_.size());
    return std::move(data_);
  }

 private:
  void lay_out() {
    if (campaign_.hold != InputHold::kZero) {
      refuse(campaign_,
             "hold: a diagnosis of periodic recordings needs inputs that are held "
             "between samples (zero)");
    }
    const PeriodicExcitation common = common_excitation(campaign_);
    std::vector<std::size_t> excited = common.lines;
    std::erase_if(excited, [&](std::size_t line) { return 2 * line >= common.period; });
    if (excited.empty()) refuse(campaign_, "experiments: no line below half the sample rate");
    data_ = periodic_frame(common.period, family_.sample_time(), excited, options_.line_factor);
    if (campaign_.sample_time &&
        std::abs(*campaign_.sample_time / data_.sample_time - 1.0) > 1e-6) {
      refuse(campaign_, fmt::format("sample_time: {} s is not the model's {} s",
                                    *campaign_.sample_time, data_.sample_time));
    }
  }

  void read_records() {
    std::vector<ReadRecord> read(campaign_.experiments.size());
    std::mutex guard;
    std::exception_ptr failure;
    std::size_t failed = read.size();
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
    for (std::size_t k = 0; k < read.size(); ++k) {
      try {
        stop_if_requested();
        read[k] = read_record(k);
      } catch (...) {
        const std::scoped_lock lock(guard);
        if (k < failed) {
          failed = k;
          failure = std::current_exception();
        }
      }
    }
    if (failure) std::rethrow_exception(failure);
    data_.outputs = read.front().outputs;
    data_.output_units = read.front().units;
    for (std::size_t k = 0; k < read.size(); ++k) keep(read[k], campaign_.experiments[k]);
    read_ = std::move(read);
  }

  [[nodiscard]] ReadRecord read_record(std::size_t index) const {
    const Experiment& experiment = campaign_.experiments[index];
    const ExperimentRecording recording = load_experiment(campaign_, index);
    const std::string where = "experiments: " + experiment.name;
    if (recording.data.pieces.size() != 1) {
      refuse(campaign_, where + ": periods in several segments; name one segment");
    }
    const auto outputs = columns_of(recording.data.signals, ChannelRole::kOutput);
    const auto inputs = columns_of(recording.data.signals, ChannelRole::kInput);
    if (static_cast<Index>(outputs.size()) != family_.output_count() ||
        static_cast<Index>(inputs.size()) != family_.input_count()) {
      refuse(campaign_,
             fmt::format("channels: {} inputs and {} outputs, but the model has {} and {}",
                         inputs.size(), outputs.size(), family_.input_count(),
                         family_.output_count()));
    }
    std::vector<Index> order = outputs;
    order.insert(order.end(), inputs.begin(), inputs.end());
    const MatrixXd signals = recording.data.pieces.front().values(Eigen::all, order);
    const PeriodicExcitation& excitation = *recording.data.excitation;
    const double step = recording.data.sample_time.value_or(0.0);
    if (excitation.period != data_.period || !(std::abs(step / data_.sample_time - 1.0) <= 1e-6)) {
      refuse(campaign_, where +
                            ": preprocess and sample_time must leave periodic recordings as they "
                            "were sampled, even and "
                            "not decimated: their inputs are held from sample to sample");
    }
    PeriodicLayout layout{excitation.period, excitation.periods, {}};
    for (Index k = 1; k <= data_.last_line; ++k)
      layout.lines.push_back(static_cast<std::size_t>(k));
    RealTransform transform(layout.period * layout.periods);
    const MatrixXcd bins = record_spectra(signals, transform);
    LineSpectra spectra = line_spectra(bins, layout, {});
    ReadRecord result;
    keep_bins(data_, bins, static_cast<Index>(layout.periods), family_.output_count(),
              result.record);
    for (const Index c : outputs) {
      result.outputs.push_back(recording.data.signals[at(c)].name);
      result.units.push_back(recording.data.signals[at(c)].unit);
    }
    result.record.name = experiment.name;
    result.record.level = experiment.level;
    split(spectra, signals, excitation, result);
    const auto references = columns_of(recording.data.signals, ChannelRole::kReference);
    MatrixXd reference;
    if (references.size() == outputs.size()) {
      reference = recording.data.pieces.front().values(Eigen::all, references);
    }
    find_mean_offset(signals, reference, excitation, result.record);
    return result;
  }

  // Outputs, inputs and noise of lines 0 ... K, and the mean period of the inputs.
  void split(LineSpectra& spectra, const MatrixXd& signals, const PeriodicExcitation& excitation,
             ReadRecord& result) const {
    const Index outputs = family_.output_count(), inputs = family_.input_count();
    const Index lines = data_.last_line;
    result.record.output = MatrixXcd::Zero(outputs, lines + 1);
    result.record.output.rightCols(lines) = spectra.values.topRows(outputs);
    result.record.input = MatrixXcd::Zero(inputs, lines + 1);
    result.record.input.rightCols(lines) = spectra.values.bottomRows(inputs);
    const auto periods = static_cast<Index>(excitation.periods);
    keep_input_period(signals.middleCols(outputs, inputs), static_cast<Index>(excitation.period),
                      periods, result.record);
    result.samples.resize(1);
    result.samples.insert(result.samples.end(), std::make_move_iterator(spectra.samples.begin()),
                          std::make_move_iterator(spectra.samples.end()));
    result.bins.resize(1);
    result.bins.insert(result.bins.end(), spectra.bins.begin(), spectra.bins.end());
  }

  // As late as possible: free motion has died down. `reference`: empty if none was recorded.
  void find_mean_offset(const MatrixXd& signals, const MatrixXd& reference,
                        const PeriodicExcitation& excitation, MeasuredRecord& record) const {
    const auto period = static_cast<Index>(excitation.period),
               periods = static_cast<Index>(excitation.periods);
    const Index outputs = family_.output_count();
    const Index next = (periods - 1) * period;  // of a single period the first stands for it
    const Index last = (periods > 1 ? next : period) - 1;
    PeriodEnd end;
    end.input = signals.row(last).tail(family_.input_count()).transpose();
    if (reference.size() > 0) {
      end.error = (reference.row(last) - signals.row(last).head(outputs)).transpose();
    }
    end.output = signals.row(next).head(outputs).transpose();
    end.output_integral = VectorXd::Zero(outputs);
    for (Index k = 1; k <= data_.last_line; ++k) {
      const std::complex<double> rate(0.0, data_.frequencies[at(k)]);
      end.output_integral +=
          2.0 / std::sqrt(static_cast<double>(period)) * (record.output.col(k) / rate).real();
    }
    end.output_mean = signals.block(next, 0, period, outputs).colwise().mean().transpose();
    record.mean_offset = family_.mean_offset(end);
  }

  void keep(ReadRecord& read, const Experiment& experiment) {
    read.record.position = position_index(experiment.position);
    read.record.group = group_index(experiment);
    (experiment.role == ExperimentRole::kEstimation ? data_.estimation : data_.validation)
        .push_back(read.record);
  }

  std::size_t position_index(const std::vector<double>& degrees) {
    const std::size_t known = data_.position_of(degrees);
    if (known < data_.positions.size()) return known;
    data_.degrees.push_back(degrees);
    VectorXd radians(static_cast<Index>(degrees.size()));
    for (std::size_t j = 0; j < degrees.size(); ++j) {
      radians(static_cast<Index>(j)) = degrees[j] * std::numbers::pi / 180.0;
    }
    data_.positions.push_back(radians);
    data_.position_names.push_back(
        degrees.empty() ? "" : fmt::format("[{:g}] deg", fmt::join(degrees, ", ")));
    return data_.degrees.size() - 1;
  }

  std::size_t group_index(const Experiment& experiment) {
    const auto found = std::ranges::find(levels_, experiment.level);
    if (found != levels_.end()) return static_cast<std::size_t>(found - levels_.begin());
    levels_.push_back(experiment.level);
    return levels_.size() - 1;
  }

  const Campaign& campaign_;
  const PlantFamily& family_;
  const PeriodicDataOptions& options_;
  PeriodicData data_;
  std::vector<ReadRecord> read_;
  std::vector<double> levels_;
};

}  // namespace

double wanted_noise_samples(const PeriodicDataOptions& options, Index outputs) {
  return std::max(options.noise_samples, 8.0 * static_cast<double>(outputs));
}

std::size_t PeriodicData::position_of(const std::vector<double>& angles) const {
  return static_cast<std::size_t>(std::ranges::find(degrees, angles) - degrees.begin());
}

PeriodicData periodic_frame(std::size_t period, double sample_time,
                            const std::vector<std::size_t>& excited, double line_factor) {
  PeriodicData frame;
  frame.period = period;
  frame.sample_time = sample_time;
  frame.excited = excited;
  frame.first_line = static_cast<Index>(excited.front());
  frame.last_line = std::min(static_cast<Index>(line_factor * static_cast<double>(excited.back())),
                             (static_cast<Index>(period) - 1) / 2);
  for (Index k = 0; k <= frame.last_line; ++k) {
    frame.frequencies.push_back(2.0 * std::numbers::pi * static_cast<double>(k) /
                                (static_cast<double>(period) * sample_time));
  }
  return frame;
}

MeasuredRecord measured_record(const PeriodicData& frame, const Eigen::Ref<const MatrixXd>& signals,
                               Index outputs, RealTransform& transform) {
  const auto period = static_cast<Index>(frame.period);
  const auto periods = static_cast<Index>(transform.length()) / period;
  const Index inputs = signals.cols() - outputs;
  MeasuredRecord record;
  keep_bins(frame, record_spectra(signals, transform), periods, outputs, record);
  record.output = MatrixXcd::Zero(outputs, frame.last_line + 1);
  record.input = MatrixXcd::Zero(inputs, frame.last_line + 1);
  for (Index k = 1; k <= frame.last_line; ++k) {
    record.output.col(k) = record.output_bins.col(k * periods);
    record.input.col(k) = record.input_bins.col(k * periods);
  }
  keep_input_period(signals.rightCols(inputs), period, periods, record);
  return record;
}

PeriodicData read_periodic_data(const Campaign& campaign, const PlantFamily& family,
                                const PeriodicDataOptions& options) {
  return PeriodicReader(campaign, family, options).read();
}

}  // namespace graybox
