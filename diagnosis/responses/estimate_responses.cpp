#include "diagnosis/responses/estimate_responses.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <exception>
#include <mutex>
#include <numbers>
#include <set>
#include <string>

#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/responses/distortion.hpp"
#include "diagnosis/responses/settling.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Eigen::Index;

constexpr double kSettlingLevel = 1e-4;  // false alarms of one recording
constexpr double kDiscoveryRate = 0.05;  // of non-linear lines
constexpr double kFeedbackShare = 1e-3;

// ---- which experiments belong together ---------------------------------------------------------

struct Group {
  std::vector<double> position;
  double level = 0.0;
  std::size_t realisation = 0;             // 0: all
  std::vector<std::size_t> experiments{};  // of the campaign, by realisation and sub-experiment
  ResponseMethod method = ResponseMethod::kPeriodic;

  [[nodiscard]] std::string place() const {
    std::string text;
    if (!position.empty()) text = fmt::format("position [{:g}]", fmt::join(position, ", "));
    if (level > 0.0) text += fmt::format("{}level {:g}", text.empty() ? "" : ", ", level);
    return text.empty() ? "responses" : text;
  }
};

std::vector<Group> group_experiments(const Campaign& campaign, const ResponseOptions& options) {
  std::vector<Group> groups;
  for (std::size_t k = 0; k < campaign.experiments.size(); ++k) {
    const Experiment& experiment = campaign.experiments[k];
    if (experiment.role != options.role) continue;
    const std::size_t realisation = options.separate_realisations ? experiment.realisation : 0;
    auto group = std::ranges::find_if(groups, [&](const Group& candidate) {
      return candidate.position == experiment.position && candidate.level == experiment.level &&
             candidate.realisation == realisation;
    });
    if (group == groups.end()) {
      groups.push_back({experiment.position, experiment.level, realisation});
      group = groups.end() - 1;
    }
    group->experiments.push_back(k);
  }
  for (Group& group : groups) {
    const bool periodic = std::ranges::all_of(group.experiments, [&](std::size_t k) {
      return campaign.experiments[k].excitation.has_value();
    });
    group.method = options.method.value_or(periodic ? ResponseMethod::kPeriodic
                                                    : ResponseMethod::kLocalPolynomial);
    std::ranges::sort(group.experiments, {}, [&](std::size_t k) {
      const Experiment& experiment = campaign.experiments[k];
      return std::pair(experiment.realisation, experiment.sub_experiment);
    });
  }
  return groups;
}

// Sub-experiments 1 ... n, the same n >= n_u in each realisation.
void check_sub_experiments(const Campaign& campaign, const Group& group, std::size_t inputs) {
  std::size_t most = inputs;
  for (const std::size_t k : group.experiments) {
    most = std::max(most, campaign.experiments[k].sub_experiment);
  }
  std::set<std::pair<std::size_t, std::size_t>> present;
  std::set<std::size_t> realisations;
  for (const std::size_t k : group.experiments) {
    const Experiment& experiment = campaign.experiments[k];
    realisations.insert(experiment.realisation);
    if (present.emplace(experiment.realisation, experiment.sub_experiment).second) continue;
    throw InputError(fmt::format(
        "{}: experiments: {}: sub_experiment {} of realisation {} is there twice ({}); number "
        "realisations and sub-experiments",
        campaign.file.string(), group.place(), experiment.sub_experiment, experiment.realisation,
        experiment.name));
  }
  for (const std::size_t realisation : realisations) {
    for (std::size_t sub = 1; sub <= most; ++sub) {
      if (present.contains({realisation, sub})) continue;
      throw InputError(fmt::format(
          "{}: experiments: {}: sub_experiment {} of realisation {} is missing; a response to {} "
          "inputs takes sub-experiments 1 to {}",
          campaign.file.string(), group.place(), sub, realisation, inputs, most));
    }
  }
}

void check_excitation(const Campaign& campaign, const Group& group) {
  const Experiment& first = campaign.experiments[group.experiments.front()];
  for (const std::size_t k : group.experiments) {
    const Experiment& experiment = campaign.experiments[k];
    if (!experiment.excitation) {
      throw InputError(fmt::format(
          "{}: experiments: {} states no excitation (period, periods, lines), which the periodic "
          "route needs; use the local polynomial method for recordings that are not periodic",
          campaign.file.string(), experiment.name));
    }
    const auto same = [](const PeriodicExcitation& a, const PeriodicExcitation& b) {
      return a.period == b.period && a.periods == b.periods && a.lines == b.lines;
    };
    if (!same(*experiment.excitation, *first.excitation)) {
      throw InputError(
          fmt::format("{}: experiments: {} and {} of one response have other periods or lines",
                      campaign.file.string(), first.name, experiment.name));
    }
  }
}

// ---- one recording ------------------------------------------------------------------------------

struct ChannelColumns {
  std::vector<Index> outputs, inputs, references;
};

ChannelColumns channel_columns(const std::vector<Signal>& signals) {
  ChannelColumns columns;
  for (std::size_t c = 0; c < signals.size(); ++c) {
    const auto at = static_cast<Index>(c);
    if (signals[c].role == ChannelRole::kOutput) columns.outputs.push_back(at);
    if (signals[c].role == ChannelRole::kInput) columns.inputs.push_back(at);
    if (signals[c].role == ChannelRole::kReference) columns.references.push_back(at);
  }
  return columns;
}

// Outputs, inputs, references.
std::vector<Index> channel_order(const ChannelColumns& columns) {
  std::vector<Index> order = columns.outputs;
  order.insert(order.end(), columns.inputs.begin(), columns.inputs.end());
  order.insert(order.end(), columns.references.begin(), columns.references.end());
  return order;
}

struct ReadRecord {
  std::vector<Signal> signals;
  double sample_time = 0.0;
  std::vector<Finding> findings;
  PeriodicExcitation excitation;          // after preprocessing
  PeriodicRecord periodic;                // of the periodic way
  std::vector<Eigen::MatrixXd> segments;  // of the other, [samples x channels]
};

std::vector<std::size_t> lines_below_nyquist(const PeriodicExcitation& excitation) {
  std::vector<std::size_t> lines = excitation.lines;
  std::erase_if(lines, [&](std::size_t line) { return 2 * line >= excitation.period; });
  return lines;
}

void find_unsettled(const std::string& name, const Eigen::Ref<const Eigen::MatrixXd>& signals,
                    const PeriodicLayout& layout, std::vector<Finding>& findings) {
  if (layout.periods < 2) return;
  for (Index c = 0; c < signals.cols(); ++c) {
    const double p = settling_p_value(signals.col(c), layout.period);
    if (p * static_cast<double>(signals.cols()) >= kSettlingLevel) continue;
    findings.push_back(
        {Severity::kWarning, "settling",
         fmt::format("{}: the first period still differs from the next more at its beginning than "
                     "at its end (p = {:.1e}): a transient; leave the first period out by "
                     "`segments` and `periods`",
                     name, p)});
    return;
  }
}

void read_periods(const Experiment& experiment, const Signals& data, const std::string& where,
                  const ResponseOptions& options, ReadRecord& result) {
  if (data.pieces.size() != 1) {
    throw InputError(where + ": periods in several segments; name one segment");
  }
  const ChannelColumns columns = channel_columns(data.signals);
  const PeriodicLayout layout{data.excitation->period, data.excitation->periods,
                              lines_below_nyquist(*data.excitation)};
  const PeriodicLayout silent{layout.period, layout.periods, detection_lines(layout)};
  RealTransform transform(layout.period * layout.periods);
  const Eigen::MatrixXd signals = data.pieces.front().values(Eigen::all, channel_order(columns));
  const Eigen::MatrixXcd spectra = record_spectra(signals, transform);
  result.periodic = {.realisation = experiment.realisation,
                     .sub_experiment = experiment.sub_experiment,
                     .spectra = line_spectra(spectra, layout, options.leakage),
                     .detection = line_spectra(spectra, silent, options.leakage)};
  result.excitation = {layout.period, layout.periods, layout.lines};
  const auto measured = static_cast<Index>(columns.outputs.size() + columns.inputs.size());
  find_unsettled(experiment.name, signals.leftCols(measured), layout, result.findings);
}

ReadRecord read_record(const Campaign& campaign, std::size_t index, ResponseMethod method,
                       const ResponseOptions& options) {
  const Experiment& experiment = campaign.experiments[index];
  const ExperimentRecording recording = load_experiment(campaign, index);
  const std::string where = campaign.file.string() + ": experiments: " + experiment.name;
  if (!recording.data.sample_time) {
    throw InputError(where + ": samples at uneven times have no spectrum; record at even times");
  }
  ReadRecord result;
  result.signals = recording.data.signals;
  result.sample_time = *recording.data.sample_time;
  result.findings = recording.findings;
  if (method == ResponseMethod::kPeriodic) {
    read_periods(experiment, recording.data, where, options, result);
    return result;
  }
  const std::vector<Index> order = channel_order(channel_columns(recording.data.signals));
  for (const SignalPiece& piece : recording.data.pieces) {
    result.segments.push_back(piece.values(Eigen::all, order));
  }
  return result;
}

// ---- findings -----------------------------------------------------------------------------------

void find_one_period(const Group& group, FrequencyResponseEstimate& estimate) {
  if (estimate.periods >= 2) return;
  estimate.findings.push_back(
      {Severity::kWarning, "periods",
       group.place() + ": one period tells nothing of the noise; record two or more"});
}

void find_nonlinear(const Group& group, FrequencyResponseEstimate& estimate) {
  for (const bool even : {false, true}) {
    std::vector<double> p_values;
    for (const DetectionLine& line : estimate.detection) {
      if (line.even() != even) continue;
      p_values.insert(p_values.end(), line.p_value.begin(), line.p_value.end());
    }
    const auto count = std::ranges::count(discoveries(p_values, kDiscoveryRate), true);
    if (count == 0) continue;
    estimate.findings.push_back(
        {Severity::kWarning, "not linear",
         fmt::format("{}: {} of {} silent {} lines answer (false discovery rate {:g})",
                     group.place(), count, p_values.size(), even ? "even" : "odd",
                     kDiscoveryRate)});
  }
  const Eigen::MatrixXd& total = estimate.nonlinearity_p_value;
  const auto count = std::ranges::count(
      discoveries({total.data(), total.data() + total.size()}, kDiscoveryRate), true);
  if (count == 0) return;
  estimate.findings.push_back(
      {Severity::kWarning, "not linear",
       fmt::format("{}: at {} of {} lines the response depends on the phases beyond the noise "
                   "(false discovery rate {:g})",
                   group.place(), count, total.size(), kDiscoveryRate)});
}

void find_biased(const Group& group, FrequencyResponseEstimate& estimate) {
  const auto& shares = estimate.feedback_share;
  const auto count =
      std::ranges::count_if(shares, [](double share) { return share > kFeedbackShare; });
  if (count == 0) return;
  const auto worst = std::ranges::max_element(shares);
  estimate.findings.push_back(
      {Severity::kWarning, "closed loop",
       fmt::format("{}: at {} of {} lines the input is hardly above its noise, where the response "
                   "tends to the inverse of the controller: at line {} by a share of {:.2g}",
                   group.place(), count, estimate.lines.size(),
                   estimate.lines[static_cast<std::size_t>(worst - shares.begin())], *worst)});
}

void add_channels(const std::vector<Signal>& signals, FrequencyResponseEstimate& estimate) {
  for (const Signal& signal : signals) {
    if (signal.role == ChannelRole::kOutput) {
      estimate.outputs.push_back(signal.name);
      estimate.output_units.push_back(signal.unit);
    } else if (signal.role == ChannelRole::kInput) {
      estimate.inputs.push_back(signal.name);
      estimate.input_units.push_back(signal.unit);
    }
  }
}

// What a group's recordings have in common.
FrequencyResponseEstimate begin_estimate(const Campaign& campaign, const Group& group,
                                         const std::vector<const ReadRecord*>& records) {
  FrequencyResponseEstimate estimate;
  estimate.method = group.method;
  estimate.position = group.position;
  estimate.level = group.level;
  estimate.realisation = group.realisation;
  estimate.hold = campaign.hold;
  estimate.sample_time = records.front()->sample_time;
  std::set<std::size_t> realisations;
  for (const std::size_t k : group.experiments) {
    realisations.insert(campaign.experiments[k].realisation);
  }
  estimate.realisations = realisations.size();
  add_channels(records.front()->signals, estimate);
  for (const ReadRecord* one : records) {
    estimate.findings.insert(estimate.findings.end(), one->findings.begin(), one->findings.end());
  }
  return estimate;
}

void respond_to_periods(const Group& group, const std::vector<const ReadRecord*>& records,
                        std::size_t references, const ResponseOptions& options,
                        FrequencyResponseEstimate& estimate) {
  const PeriodicExcitation& excitation = records.front()->excitation;
  estimate.period = excitation.period;
  estimate.periods = excitation.periods;
  estimate.lines = excitation.lines;
  for (const std::size_t line : estimate.lines) {
    estimate.frequencies.push_back(2.0 * std::numbers::pi * static_cast<double>(line) /
                                   (static_cast<double>(estimate.period) * estimate.sample_time));
  }
  std::vector<const PeriodicRecord*> periodic;
  for (const ReadRecord* one : records) periodic.push_back(&one->periodic);
  estimate_periodic_response(periodic, references, options.periodic, group.place(), estimate);
  find_one_period(group, estimate);
  find_nonlinear(group, estimate);
  find_biased(group, estimate);
}

void respond_to_any(const Group& group, const std::vector<const ReadRecord*>& records,
                    std::size_t references, const ResponseOptions& options,
                    FrequencyResponseEstimate& estimate) {
  Index shortest = records.front()->segments.front().rows(), longest = shortest;
  for (const ReadRecord* one : records) {
    for (const Eigen::MatrixXd& segment : one->segments) {
      shortest = std::min(shortest, segment.rows());
      longest = std::max(longest, segment.rows());
    }
  }
  if (shortest < longest) {
    estimate.findings.push_back(
        {Severity::kWarning, "length",
         fmt::format("{}: segments of {} to {} samples; of each the first {} are used",
                     group.place(), shortest, longest, shortest)});
  }
  const auto samples = static_cast<std::size_t>(shortest);
  RealTransform transform(samples);
  std::vector<Eigen::MatrixXcd> spectra;
  for (const ReadRecord* one : records) {
    for (const Eigen::MatrixXd& segment : one->segments) {
      spectra.push_back(record_spectra(segment, transform));
    }
  }
  estimate_local_polynomial(spectra, samples, references, options.local_polynomial, group.place(),
                            estimate);
  if (references == estimate.inputs.size() && options.local_polynomial.joint) return;
  estimate.findings.push_back(
      {Severity::kWarning, "closed loop",
       group.place() + ": without a reference for each input, a controller's response to noise "
                       "can't be told from the plant: if the inputs come from feedback, the "
                       "response is biased towards its inverse"});
}

FrequencyResponseEstimate respond(const Campaign& campaign, const Group& group,
                                  const std::vector<const ReadRecord*>& records,
                                  const ResponseOptions& options) {
  FrequencyResponseEstimate estimate = begin_estimate(campaign, group, records);
  const std::size_t references = channel_columns(records.front()->signals).references.size();
  if (group.method == ResponseMethod::kPeriodic) {
    respond_to_periods(group, records, references, options, estimate);
  } else {
    respond_to_any(group, records, references, options, estimate);
  }
  return estimate;
}

// ---- threads ------------------------------------------------------------------------------------

// Runs work(0 ... count - 1); the exception of the lowest index is thrown on. False: stopped.
template <typename Work>
bool run_parallel(std::size_t count, const ResponseOptions& options, bool report,
                  const Work& work) {
  std::mutex guard;
  std::exception_ptr failure;
  std::size_t failed = count, done = 0;
  bool stopped = false;
#pragma omp parallel for num_threads(options.threads) schedule(dynamic)
  for (std::size_t k = 0; k < count; ++k) {
    {
      const std::scoped_lock lock(guard);
      if (stopped || k > failed) continue;
      stopped = options.keep_going && !options.keep_going();
    }
    try {
      work(k);
      const std::scoped_lock lock(guard);
      ++done;
      if (report && options.report) options.report(done, count);
    } catch (...) {
      const std::scoped_lock lock(guard);
      if (k < failed) {
        failed = k;
        failure = std::current_exception();
      }
    }
  }
  if (failure) std::rethrow_exception(failure);
  return !stopped;
}

}  // namespace

std::vector<FrequencyResponseEstimate> estimate_responses(const Campaign& campaign,
                                                          const ResponseOptions& options) {
  const std::vector<Group> groups = group_experiments(campaign, options);
  if (groups.empty()) {
    throw InputError(
        fmt::format("{}: experiments: none has the role {}", campaign.file.string(),
                    options.role == ExperimentRole::kEstimation ? "estimation" : "validation"));
  }
  std::vector<std::pair<std::size_t, const Group*>> tasks;
  for (const Group& group : groups) {
    if (group.method == ResponseMethod::kPeriodic) check_excitation(campaign, group);
    for (const std::size_t k : group.experiments) tasks.emplace_back(k, &group);
  }
  std::vector<ReadRecord> read(campaign.experiments.size());
  if (!run_parallel(tasks.size(), options, true, [&](std::size_t t) {
        const auto& [experiment, group] = tasks[t];
        read[experiment] = read_record(campaign, experiment, group->method, options);
      })) {
    return {};
  }
  const ChannelColumns columns = channel_columns(read[tasks.front().first].signals);
  if (columns.inputs.empty() || columns.outputs.empty()) {
    throw InputError(fmt::format("{}: channels: a frequency response needs an input and an output",
                                 campaign.file.string()));
  }
  for (const Group& group : groups) {
    if (group.method != ResponseMethod::kPeriodic) continue;
    check_sub_experiments(campaign, group, columns.inputs.size());
  }
  std::vector<FrequencyResponseEstimate> estimates(groups.size());
  if (!run_parallel(groups.size(), options, false, [&](std::size_t g) {
        std::vector<const ReadRecord*> records;
        for (const std::size_t k : groups[g].experiments) records.push_back(&read[k]);
        estimates[g] = respond(campaign, groups[g], records, options);
      })) {
    return {};
  }
  return estimates;
}

}  // namespace graybox
