#include "diagnosis/simulation/excitation_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/signals/multisine.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

constexpr std::size_t kMostFrequencies = 1'000'000;
constexpr double kMostRecordings = 1e6;

std::vector<Eigen::VectorXd> read_positions(const YamlField& field, std::size_t joints) {
  std::vector<Eigen::VectorXd> positions;
  for (const YamlField& item : field.items()) {
    const std::vector<double> angles = item.numbers(joints);
    positions.push_back(
        Eigen::Map<const Eigen::VectorXd>(angles.data(), static_cast<Eigen::Index>(angles.size())));
  }
  if (positions.empty()) field.fail("needs at least one position");
  return positions;
}

std::vector<double> read_levels(const YamlField& field) {
  std::vector<double> levels;
  for (const YamlField& item : field.items()) levels.push_back(item.positive());
  if (levels.empty()) field.fail("needs at least one level");
  return levels;
}

// Hz.
std::vector<double> read_frequencies(const YamlField& root, const SimulatedSystem& system) {
  std::vector<double> frequencies;
  if (!root.has("frequencies") && !system.frequencies.empty()) return system.frequencies;
  const YamlField field = root.at("frequencies");
  if (field.is_list()) {
    for (const YamlField& item : field.items()) {
      frequencies.push_back(item.positive());
      if (frequencies.size() > 1 && frequencies[frequencies.size() - 2] >= frequencies.back()) {
        item.fail("frequencies must increase");
      }
    }
    if (frequencies.empty()) field.fail("must hold at least one frequency");
    return frequencies;
  }
  field.allow_keys({"from", "to", "count", "spacing"});
  const double from = field.at("from").positive(), to = field.at("to").positive();
  const std::size_t count = field.at("count").count();
  if (count > kMostFrequencies) {
    field.at("count").fail(fmt::format("must be at most {}, is {}", kMostFrequencies, count));
  }
  const bool is_log = field.at("spacing").choice({"log", "linear"}) == "log";
  if (to < from) field.at("to").fail("must not be below 'from'");
  for (std::size_t k = 0; k < count; ++k) {
    const double share = count == 1 ? 0.0 : static_cast<double>(k) / static_cast<double>(count - 1);
    frequencies.push_back(is_log ? from * std::pow(to / from, share) : from + share * (to - from));
  }
  return frequencies;
}

// Every `detection`-th of the odd lines is left out, the last of each group.
std::vector<std::size_t> without_detection_lines(const std::vector<std::size_t>& lines,
                                                 std::size_t detection) {
  if (detection == 0) return lines;
  std::vector<std::size_t> excited;
  for (std::size_t k = 0; k < lines.size(); ++k) {
    if (k % detection != detection - 1) excited.push_back(lines[k]);
  }
  return excited;
}

std::size_t whole(const YamlField& root, const char* key, std::size_t fallback) {
  return root.has(key) ? root.at(key).count() : fallback;
}

// Also zero, which count() refuses.
std::size_t whole_or_zero(const YamlField& root, const char* key, std::size_t fallback) {
  if (!root.has(key)) return fallback;
  return root.at(key).number() == 0.0 ? 0 : root.at(key).count();
}

void read_places(const YamlField& root, const SimulatedSystem& system, ExcitationPlan& plan) {
  if (system.joints == 0) {
    for (const char* key : {"plant", "positions", "noise"}) {
      if (root.has(key)) root.at(key).fail("is for robots; a lumped model has none in its plan");
    }
    plan.plant = SimulatedSystem::PlantKind::kLumped;
    plan.positions.emplace_back();
    return;
  }
  plan.plant = root.at("plant").choice({"local", "robot"}) == "local"
                   ? SimulatedSystem::PlantKind::kLocal
                   : SimulatedSystem::PlantKind::kRobot;
  plan.positions = read_positions(root.at("positions"), system.joints);
  plan.noise_psd_slope =
      root.has("noise") ? root.at("noise").non_negative() : system.velocity_psd_slope;
}

// A recording is simulated sample by sample and kept whole: neither is done for ever, or beyond
// memory.
constexpr double kMostSamples = 1e9;

void require_feasible(const YamlField& root, const SimulatedSystem& system,
                      const ExcitationPlan& plan) {
  const auto period = static_cast<double>(plan.period);
  const double samples = period * static_cast<double>(plan.settling_periods + plan.periods);
  if (samples > kMostSamples) {
    const char* key = plan.settling_periods > plan.periods ? "settling_periods" : "periods";
    root.at(root.has(key) ? key : "period")
        .fail(fmt::format("period x (settling_periods + periods) makes {:.3g} samples a recording; "
                          "at most {:.0g} are simulated",
                          samples, kMostSamples));
  }
  // The recording, one period of the reference and of its transform, and the file's copy.
  const std::size_t channels =
      system.references.size() + system.inputs.size() + system.outputs.size();
  const std::size_t a_sample = sizeof(double) * (2 * channels * plan.periods + 6);
  const double most =
      std::min(static_cast<double>(available_memory() / a_sample),
               kMostSamples / static_cast<double>(plan.settling_periods + plan.periods));
  if (period > most) {
    root.at("period").fail(
        fmt::format("{} samples with {} periods of {} channels take {:.2f} GB of memory; at most "
                    "{:.0f} samples fit",
                    plan.period, plan.periods, channels,
                    1e-9 * period * static_cast<double>(a_sample), std::floor(most)));
  }
}

}  // namespace

std::string PlannedExperiment::name() const {
  return fmt::format("p{}_l{}_r{}_e{}", position + 1, level + 1, realisation + 1,
                     sub_experiment + 1);
}

ExcitationPlan read_plan(const std::filesystem::path& file, const SimulatedSystem& system) {
  const YamlField root = YamlField::load(file);
  root.allow_keys({"format", "plant", "positions", "levels", "realisations",
                   "validation_realisations", "period", "settling_periods", "periods",
                   "frequencies", "detection_lines", "phase_draws", "crest_limit", "noise",
                   "data"});
  (void)root.at("format").choice({"graybox-plan/1"});
  ExcitationPlan plan;
  read_places(root, system, plan);
  plan.levels = read_levels(root.at("levels"));
  plan.realisations = whole(root, "realisations", plan.realisations);
  plan.validation_realisations = whole_or_zero(root, "validation_realisations", 0);
  if (plan.validation_realisations >= plan.realisations) {
    root.at("validation_realisations").fail("must leave a realisation for estimation");
  }
  const double recordings = static_cast<double>(plan.realisations) *
                            static_cast<double>(plan.levels.size()) *
                            static_cast<double>(plan.positions.size());
  if (recordings > kMostRecordings) {
    root.at("realisations")
        .fail(fmt::format("{:.3g} recordings are planned for each input; at most {:.0g} are made",
                          recordings, kMostRecordings));
  }
  plan.period = root.at("period").count();
  plan.settling_periods = whole_or_zero(root, "settling_periods", plan.settling_periods);
  plan.periods = whole(root, "periods", plan.periods);
  plan.phase_draws = whole(root, "phase_draws", plan.phase_draws);
  if (root.has("crest_limit")) plan.crest_limit = root.at("crest_limit").positive();
  if (root.has("data") && root.at("data").choice({"h5", "csv"}) == "csv") {
    plan.data = ExcitationPlan::DataFormat::kCsv;
  }
  require_feasible(root, system, plan);
  const std::vector<std::size_t> lines =
      odd_lines(read_frequencies(root, system), plan.period, system.sample_time);
  const std::size_t detection = whole_or_zero(root, "detection_lines", 0);
  if (detection == 1) root.at("detection_lines").fail("must be 0 or at least 2: 1 leaves no line");
  plan.lines = without_detection_lines(lines, detection);
  if (2 * plan.lines.back() >= plan.period) {
    root.at("period").fail(
        fmt::format("is too short: {:.4g} Hz lies beyond half the sample rate",
                    static_cast<double>(plan.lines.back()) /
                        (static_cast<double>(plan.period) * system.sample_time)));
  }
  return plan;
}

std::vector<PlannedExperiment> planned_experiments(const ExcitationPlan& plan,
                                                   Eigen::Index inputs) {
  std::vector<PlannedExperiment> experiments;
  for (std::size_t p = 0; p < plan.positions.size(); ++p) {
    for (std::size_t l = 0; l < plan.levels.size(); ++l) {
      for (std::size_t r = 0; r < plan.realisations; ++r) {
        for (Eigen::Index e = 0; e < inputs; ++e) experiments.push_back({p, l, r, e});
      }
    }
  }
  return experiments;
}

}  // namespace graybox
