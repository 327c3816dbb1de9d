#include "diagnosis/simulation/simulated_campaign.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <fstream>
#include <iterator>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numbers>
#include <vector>

#include "diagnosis/signals/multisine.hpp"
#include "diagnosis/simulation/closed_loop.hpp"
#include "diagnosis/simulation/plant.hpp"
#include "diagnosis/simulation/recording_writer.hpp"
#include "problems/base/error.hpp"
#include "problems/base/program_version.hpp"
#include "problems/base/random.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/folder_lock.hpp"
#include "problems/files/temporary_name.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

// A seed of its own for each place in the plan.
std::uint64_t derived_seed(std::uint64_t seed, std::initializer_list<std::uint64_t> place) {
  for (const std::uint64_t index : place)
    seed = Random(seed + 0x632be59bd9b4e019ULL * index).next();
  return seed;
}

std::string file_name(const ExcitationPlan& plan, const PlannedExperiment& experiment) {
  return experiment.name() + (plan.data == ExcitationPlan::DataFormat::kHdf5 ? ".h5" : ".csv");
}

// Phases are those of the position, level and realisation; its sub-experiments share them.
Multisine excitation(const SimulatedSystem& system, const ExcitationPlan& plan,
                     const PlannedExperiment& experiment, std::uint64_t seed) {
  return Multisine(
      {.period = plan.period,
       .lines = plan.lines,
       .relative_amplitude = {},
       .inputs = static_cast<Eigen::Index>(system.inputs.size()),
       .rms = plan.levels[experiment.level],
       .phase_draws = plan.phase_draws,
       .crest_limit = plan.crest_limit},
      derived_seed(seed, {1, experiment.position, experiment.level, experiment.realisation}));
}

// What does not fit is said with the files that it stands in.
std::unique_ptr<Plant> plant_at(const SimulatedSystem& system, const ExcitationPlan& plan,
                                std::size_t position) {
  try {
    return system.plant(plan.plant, plan.positions[position] * (std::numbers::pi / 180.0));
  } catch (const InputError& error) {
    std::string files = system.files.front().string();
    if (system.hidden) files += " with " + system.hidden->string();
    const Eigen::VectorXd& angles = plan.positions[position];
    if (angles.size() > 0) files += fmt::format(", position [{:g}]", fmt::join(angles, ", "));
    throw InputError(fmt::format("{}: {}", files, error.what()));
  }
}

// What can't be done is said before anything is written.
void check_feasible(const SimulatedSystem& system, const ExcitationPlan& plan,
                    const std::vector<PlannedExperiment>& experiments, std::uint64_t seed) {
  for (std::size_t p = 0; p < plan.positions.size(); ++p) (void)plant_at(system, plan, p);
  if (plan.crest_limit == 0.0) return;
  for (const PlannedExperiment& experiment : experiments) {
    if (experiment.sub_experiment == 0) (void)excitation(system, plan, experiment, seed);
  }
}

std::vector<RecordedChannel> channels_of(const SimulatedSystem& system,
                                         const Recording& recording) {
  std::vector<RecordedChannel> channels;
  const auto add = [&](const std::vector<SimulatedSystem::Signal>& signals,
                       const Eigen::MatrixXd& rows) {
    for (std::size_t k = 0; k < signals.size(); ++k) {
      channels.push_back(
          {signals[k].name, signals[k].unit, rows.row(static_cast<Eigen::Index>(k)).transpose()});
    }
  };
  add(system.references, recording.reference);
  add(system.inputs, recording.input);
  add(system.outputs, recording.output);
  return channels;
}

// What all the recordings will take, from the share that is done after the first seconds.
class WorkForecast {
 public:
  WorkForecast(const ExcitationPlan& plan, std::size_t recordings, const SimulationOptions& options)
      : options_(&options),
        samples_(static_cast<double>(plan.period) *
                 static_cast<double>(plan.settling_periods + plan.periods) *
                 static_cast<double>(recordings)) {}

  // From any thread. Throws InputError where it would take for ever.
  void add(Eigen::Index samples) {
    const std::scoped_lock lock(mutex_);
    done_ += static_cast<double>(samples);
    const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
    if (told_ || seconds < kFirstSeconds || done_ == 0.0) return;
    told_ = true;
    const double all = seconds * samples_ / done_;
    if (all > kLongest) {
      throw InputError(
          fmt::format("the simulation would take {:.0f} days: shorten period, periods, "
                      "settling_periods or the lists of the plan, or look for a stiffness, damping "
                      "or friction that is far too large",
                      all / 86400.0));
    }
    if (options_->forecast && all > kWorthTelling) options_->forecast(all);
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr double kFirstSeconds = 5.0;
  static constexpr double kWorthTelling = 60.0;
  static constexpr double kLongest = 30.0 * 86400.0;
  const SimulationOptions* options_;
  double samples_;
  Clock::time_point start_ = Clock::now();
  std::mutex mutex_;  // of the two below
  double done_ = 0.0;
  bool told_ = false;
};

Recording simulate_one(const SimulatedSystem& system, const ExcitationPlan& plan,
                       const PlannedExperiment& experiment, const SimulationOptions& options,
                       WorkForecast& forecast) {
  const auto plant = plant_at(system, plan, experiment.position);
  const Multisine signal = excitation(system, plan, experiment, options.seed);
  const auto sub = static_cast<std::uint64_t>(experiment.sub_experiment);
  const ClosedLoopOptions loop{
      .settling_periods = plan.settling_periods,
      .periods = plan.periods,
      .noise_psd_slope = plan.noise_psd_slope,
      .white_noise = system.white_noise,
      .seed = derived_seed(
          options.seed, {2, experiment.position, experiment.level, experiment.realisation, sub})};
  try {
    return simulate_closed_loop(
        *plant, system.controller, system.sample_time, signal.reference(experiment.sub_experiment),
        loop, options.keep_going, [&](Eigen::Index samples) { forecast.add(samples); });
  } catch (const UnstableMotion& error) {
    throw UnstableMotion(fmt::format("{}: {}", experiment.name(), error.what()));
  }
}

// ---- campaign.yaml ------------------------------------------------------------------------------

void append_channels(fmt::memory_buffer& text, const SimulatedSystem& system) {
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "channels:\n");
  const auto add = [&](const std::vector<SimulatedSystem::Signal>& signals, const char* is) {
    for (const auto& [name, unit] : signals) {
      fmt::format_to(out, "  - {{name: {}, unit: {}, is: {}}}\n", name, unit, is);
    }
  };
  add(system.inputs, "input");
  add(system.outputs, "output");
  add(system.references, "reference");
}

// Standard deviation of v(t) = (n(t) - n(t-1)) / T_s + white noise.
void append_noise(fmt::memory_buffer& text, const SimulatedSystem& system,
                  const ExcitationPlan& plan) {
  std::vector<std::string> entries;
  for (std::size_t k = 0; k < system.outputs.size(); ++k) {
    const double white =
        system.white_noise.size() > 0 ? system.white_noise(static_cast<Eigen::Index>(k)) : 0.0;
    const double deviation =
        std::hypot(std::sqrt(2.0 * plan.noise_psd_slope) / system.sample_time, white);
    if (deviation > 0.0) {
      entries.push_back(fmt::format("{}: {:.10g}", system.outputs[k].name, deviation));
    }
  }
  if (entries.empty()) return;
  fmt::format_to(std::back_inserter(text), "noise: {{{}}}\n", fmt::join(entries, ", "));
}

void append_experiment(fmt::memory_buffer& text, const ExcitationPlan& plan,
                       const PlannedExperiment& experiment) {
  const Eigen::VectorXd& position = plan.positions[experiment.position];
  const bool validates = experiment.realisation >= plan.realisations - plan.validation_realisations;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "  - file: {}\n", file_name(plan, experiment));
  if (position.size() > 0) {
    fmt::format_to(out, "    position: [{:g}]\n", fmt::join(position, ", "));
  }
  fmt::format_to(
      out,
      "    level: {:g}\n    realisation: {}\n"
      "    sub_experiment: {}\n    excitation: {{period: {}, periods: {}, lines: [{}]}}\n"
      "    segments: []\n    role: {}\n",
      plan.levels[experiment.level], experiment.realisation + 1, experiment.sub_experiment + 1,
      plan.period, plan.periods, fmt::join(plan.lines, ", "),
      validates ? "validation" : "estimation");
}

const char* plant_name(SimulatedSystem::PlantKind kind) {
  switch (kind) {
    case SimulatedSystem::PlantKind::kLocal:
      return "local models at the positions below";
    case SimulatedSystem::PlantKind::kRobot:
      return "the non-linear robot at the positions below";
    case SimulatedSystem::PlantKind::kLumped:
      break;
  }
  return "a lumped model";
}

std::string campaign_text(const SimulatedSystem& system, const ExcitationPlan& plan,
                          const std::vector<PlannedExperiment>& experiments) {
  fmt::memory_buffer text;
  fmt::format_to(std::back_inserter(text),
                 "# Simulated by {}: {}.\nformat: graybox-campaign/1\nmodel: {}\n"
                 "sample_time: {:.10g}\n",
                 written_by(), plant_name(plan.plant), system.files.front().filename().string(),
                 system.sample_time);
  append_channels(text, system);
  fmt::format_to(std::back_inserter(text), "hold: zero\n");
  append_noise(text, system, plan);
  fmt::format_to(std::back_inserter(text), "preprocess: []\nexperiments:\n");
  for (const PlannedExperiment& experiment : experiments) {
    append_experiment(text, plan, experiment);
  }
  return fmt::to_string(text);
}

// ---- the folder ---------------------------------------------------------------------------------

// What a run may leave that was killed before it had stated what it simulates.
bool is_leftover(const fs::path& file) {
  const std::string name = file.filename().string();
  return is_temporary_name(name) || name.starts_with("simulation.json.");
}

bool holds_nothing(const fs::path& folder) {
  return std::ranges::all_of(fs::directory_iterator(folder), is_leftover);
}

// The folder is of this simulation, or becomes so.
void claim_folder(const fs::path& folder, const SimulationOptions& options) {
  const fs::path file = folder / "simulation.json";
  nlohmann::ordered_json stamp{
      {"format", "graybox-simulation/1"}, {"inputs", options.identity}, {"seed", options.seed}};
  if (std::ifstream stream(file); stream) {
    nlohmann::json there = nlohmann::json::parse(stream, nullptr, false);
    if (there.is_object()) there.erase("written_by");
    if (there == nlohmann::json(stamp)) return;
    throw InputError(
        fmt::format("{}: holds recordings of another model, plan or seed; choose another folder or "
                    "remove it",
                    folder.string()));
  }
  if (!holds_nothing(folder)) {
    throw InputError(fmt::format("{}: is not empty and holds no simulation; choose another folder",
                                 folder.string()));
  }
  stamp["written_by"] = written_by();
  write_text_file(file.string(), stamp.dump(2) + "\n");
}

}  // namespace

SimulationOutcome simulate_campaign(const SimulatedSystem& system, const ExcitationPlan& plan,
                                    const fs::path& folder, const SimulationOptions& options) {
  const auto experiments =
      planned_experiments(plan, static_cast<Eigen::Index>(system.inputs.size()));
  check_feasible(system, plan, experiments, options.seed);
  const FolderLock folder_lock(folder);
  claim_folder(folder, options);
  SimulationOutcome outcome{.recordings = experiments.size()};
  std::vector<std::size_t> missing;
  for (std::size_t k = 0; k < experiments.size(); ++k) {
    if (!fs::exists(folder / file_name(plan, experiments[k]))) missing.push_back(k);
  }
  outcome.already_there = experiments.size() - missing.size();
  std::size_t done = outcome.already_there;
  std::atomic<bool> stopped = false;
  WorkForecast forecast(plan, missing.size(), options);
  std::exception_ptr failure;
  std::mutex writing;  // HDF5 is not safe among threads; also guards `done` and `failure`
#pragma omp parallel for num_threads(options.threads) schedule(dynamic)
  for (std::size_t m = 0; m < missing.size(); ++m) {
    if (stopped) continue;
    const PlannedExperiment& experiment = experiments[missing[m]];
    try {
      const Recording recording = simulate_one(system, plan, experiment, options, forecast);
      const std::scoped_lock lock(writing);
      if (recording.output.size() == 0) {
        stopped = true;
        continue;
      }
      write_recording(folder / file_name(plan, experiment), system.sample_time,
                      channels_of(system, recording));
      ++done;
      if (options.report) options.report(done, experiments.size());
    } catch (...) {
      const std::scoped_lock lock(writing);
      if (!failure) failure = std::current_exception();
      stopped = true;
    }
  }
  if (failure) std::rethrow_exception(failure);
  outcome.complete = !stopped;
  if (outcome.complete) {
    write_text_file((folder / "campaign.yaml").string(), campaign_text(system, plan, experiments));
  }
  return outcome;
}

}  // namespace graybox
