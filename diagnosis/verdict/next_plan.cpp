#include "diagnosis/verdict/next_plan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>
#include <tuple>

#include "diagnosis/verdict/verdict_words.hpp"

namespace graybox {
namespace {

using LevelAndBand = std::tuple<double, double, double>;

// Lines of the campaign within the band.
std::size_t lines_in(const PeriodicExcitation& excitation, double sample_time, double from,
                     double to) {
  const double spacing = 1.0 / (sample_time * static_cast<double>(excitation.period));
  return static_cast<std::size_t>(std::ranges::count_if(excitation.lines, [&](std::size_t line) {
    const double frequency = spacing * static_cast<double>(line);
    return frequency > from * (1.0 - 1e-9) && frequency < to * (1.0 + 1e-9);
  }));
}

std::size_t realisations_of(const Campaign& campaign) {
  std::set<std::size_t> known;
  for (const Experiment& experiment : campaign.experiments) known.insert(experiment.realisation);
  return known.size();
}

}  // namespace

std::vector<std::string> next_plans(const NextExperiment& next, const Campaign& campaign,
                                    bool has_plant) {
  std::map<LevelAndBand, std::vector<const NextExperiment::Share*>> groups;
  for (const NextExperiment::Share& share : next.shares) {
    groups[{share.option.level, share.option.from, share.option.to}].push_back(&share);
  }
  const PeriodicExcitation& excitation = *campaign.experiments.front().excitation;
  std::vector<std::string> plans;
  for (const auto& [key, shares] : groups) {
    const auto& [level, from, to] = key;
    double weight = 0.0;
    for (const NextExperiment::Share* share : shares) weight += share->weight;
    std::string text = fmt::format(
        "# {:.0f} % of the recordings that tell two explanations apart.\nformat: graybox-plan/1\n",
        100.0 * weight);
    if (has_plant) {
      text += "plant: robot\npositions:                  # degrees\n";
      for (const NextExperiment::Share* share : shares) {
        text += fmt::format("  - [{}]     # weight {:.3g}\n",
                            fmt::join(share->option.position_degrees, ", "), share->weight);
      }
    }
    text += fmt::format(
        "levels: [{}]\nrealisations: {}\nvalidation_realisations: 1\nperiod: {}\nperiods: {}\n"
        "frequencies: {{from: {:.6g}, to: {:.6g}, count: {}, spacing: log}}    # Hz\n",
        level, std::max<std::size_t>(2, realisations_of(campaign)), excitation.period,
        std::max<std::size_t>(2, excitation.periods), from, to,
        lines_in(excitation, *campaign.sample_time, from, to));
    plans.push_back(std::move(text));
  }
  return plans;
}

std::vector<std::string> next_motions(const NextExperiment& next) {
  std::vector<std::string> files;
  for (const NextExperiment::Share& share : next.shares) {
    if (!share.option.motion) continue;
    const PlannedMotion& motion = *share.option.motion;
    std::string text = fmt::format("# {:.0f} % of the time: {}\ntime (s)", 100.0 * share.weight,
                                   experiment_words(share.option));
    for (std::size_t c = 0; c < motion.channels.size(); ++c) {
      text += fmt::format(",{} ({})", motion.channels[c], motion.units[c]);
    }
    text += '\n';
    for (Eigen::Index t = 0; t < motion.time.size(); ++t) {
      text += fmt::format("{:.6g}", motion.time(t));
      for (Eigen::Index c = 0; c < motion.position.cols(); ++c) {
        text += fmt::format(",{:.7g}", motion.position(t, c));
      }
      text += '\n';
    }
    files.push_back(std::move(text));
  }
  return files;
}

}  // namespace graybox
