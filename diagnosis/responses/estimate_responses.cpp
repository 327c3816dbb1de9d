#include "graybox/diagnosis/responses/estimate_responses.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <exception>
#include <mutex>
#include <numbers>
#include <set>
#include <string>

#include "graybox/diagnosis/recordings/experiment_recording.hpp"
#include "graybox/problems/error.hpp"

namespace graybox {
namespace {

using Eigen::Index;

// ---- which experiments belong together ---------------------------------------------------------

struct Group {
  std::vector<double> position;
  double level = 0.0;
  std::size_t realisation = 0;             // 0: all
  std::vector<std::size_t> experiments{};  // of the campaign, by realisation and sub-experiment

  [[nodiscard]] std::string place() const {
    std::string text;
    if (!position.empty()) text = fmt::format("position [{:g}], ", fmt::join(position, ", "));
    return text + fmt::format("level {:g}", level);
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

// ---- one recording -------------------------------------------------------------------------------

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

struct ReadRecord {
  PeriodicRecord record;
  std::vector<Signal> signals;
  PeriodicExcitation excitation;  // after preprocessing
  double sample_time = 0.0;
  std::vector<Finding> findings;
};

std::vector<std::size_t> lines_below_nyquist(const PeriodicExcitation& excitation) {
  std::vector<std::size_t> lines = excitation.lines;
  std::erase_if(lines, [&](std::size_t line) { return 2 * line >= excitation.period; });
  return lines;
}

ReadRecord read_record(const Campaign& campaign, std::size_t index,
                       const ResponseOptions& options) {
  const Experiment& experiment = campaign.experiments[index];
  const ExperimentRecording recording = load_experiment(campaign, index);
  const std::string where = campaign.file.string() + ": experiments: " + experiment.name;
  if (!recording.data.sample_time) {
    throw InputError(where + ": samples at uneven times have no lines; state a sample_time");
  }
  if (recording.data.pieces.size() != 1) {
    throw InputError(where + ": periods in several segments; name one segment");
  }
  const ChannelColumns columns = channel_columns(recording.data.signals);
  std::vector<Index> order = columns.outputs;
  order.insert(order.end(), columns.inputs.begin(), columns.inputs.end());
  order.insert(order.end(), columns.references.begin(), columns.references.end());
  const PeriodicExcitation& excitation = *recording.data.excitation;
  const PeriodicLayout layout{excitation.period, excitation.periods,
                              lines_below_nyquist(excitation)};
  RealTransform transform(layout.period * layout.periods);
  ReadRecord result{{experiment.realisation, experiment.sub_experiment, {}},
                    recording.data.signals,
                    excitation,
                    *recording.data.sample_time,
                    recording.findings};
  result.record.spectra = line_spectra(recording.data.pieces.front().values(Eigen::all, order),
                                       layout, options.leakage, transform);
  return result;
}

// ---- one response --------------------------------------------------------------------------------

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

FrequencyResponseEstimate respond(const Group& group, const std::vector<ReadRecord>& read,
                                  const std::vector<std::size_t>& place_of_experiment,
                                  const ResponseOptions& options) {
  std::vector<const PeriodicRecord*> records;
  FrequencyResponseEstimate estimate;
  for (const std::size_t k : group.experiments) {
    const ReadRecord& one = read[place_of_experiment[k]];
    records.push_back(&one.record);
    estimate.findings.insert(estimate.findings.end(), one.findings.begin(), one.findings.end());
  }
  const ReadRecord& first = read[place_of_experiment[group.experiments.front()]];
  estimate.position = group.position;
  estimate.level = group.level;
  estimate.realisation = group.realisation;
  estimate.period = first.excitation.period;
  estimate.periods = first.excitation.periods;
  estimate.sample_time = first.sample_time;
  estimate.lines = lines_below_nyquist(first.excitation);
  for (const std::size_t line : estimate.lines) {
    estimate.frequencies.push_back(2.0 * std::numbers::pi * static_cast<double>(line) /
                                   (static_cast<double>(estimate.period) * estimate.sample_time));
  }
  add_channels(first.signals, estimate);
  const std::size_t references = channel_columns(first.signals).references.size();
  estimate_periodic_response(records, references, options.periodic, group.place(), estimate);
  if (estimate.periods < 2) {
    estimate.findings.push_back(
        {Severity::kWarning, "periods",
         group.place() + ": one period tells nothing of the noise; record two or more"});
  }
  return estimate;
}

// ---- threads -------------------------------------------------------------------------------------

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
  std::vector<std::size_t> experiments;
  std::vector<std::size_t> place_of_experiment(campaign.experiments.size(), 0);
  for (const Group& group : groups) {
    check_excitation(campaign, group);
    for (const std::size_t k : group.experiments) {
      place_of_experiment[k] = experiments.size();
      experiments.push_back(k);
    }
  }
  std::vector<ReadRecord> read(experiments.size());
  if (!run_parallel(experiments.size(), options, true, [&](std::size_t k) {
        read[k] = read_record(campaign, experiments[k], options);
      })) {
    return {};
  }
  const ChannelColumns columns = channel_columns(read.front().signals);
  if (columns.inputs.empty() || columns.outputs.empty()) {
    throw InputError(fmt::format("{}: channels: a frequency response needs an input and an output",
                                 campaign.file.string()));
  }
  for (const Group& group : groups) check_sub_experiments(campaign, group, columns.inputs.size());
  std::vector<FrequencyResponseEstimate> estimates(groups.size());
  if (!run_parallel(groups.size(), options, false, [&](std::size_t g) {
        estimates[g] = respond(groups[g], read, place_of_experiment, options);
      })) {
    return {};
  }
  return estimates;
}

}  // namespace graybox
