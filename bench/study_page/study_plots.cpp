#include "bench/study_page/study_plots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string_view>

namespace graybox::bench {
namespace {

// The paper's two formulations and the default.
constexpr std::array<std::string_view, 3> kHeavy{"primal_interior_point", "dual_interior_point",
                                                 "column_generation"};

PlotSeries series_of(const PageFacts& facts, const std::string& solver) {
  PlotSeries series;
  series.name = solver;
  series.style = facts.place_of(solver);
  series.is_heavy = std::ranges::find(kHeavy, solver) != kHeavy.end();
  return series;
}

std::string exponent_words(const std::vector<SolverLaw>& laws, const std::string& solver) {
  const auto law = std::ranges::find(laws, solver, &SolverLaw::solver);
  if (law == laws.end()) return "";
  std::string words = fmt::format("Q^{:.2f}", law->time.exponent);
  if (std::isfinite(law->time.upper)) {
    words += fmt::format(" ±{:.2f}", 0.5 * (law->time.upper - law->time.lower));
  }
  return words;
}

ComparisonPlot figure_3(const PageFacts& facts, const std::vector<SolverLaw>& laws) {
  ComparisonPlot plot{
      .id = "figure-3",
      .title = "Time against the number of candidates",
      .x = {.label = "candidates Q", .logarithmic = true},
      .y = {.label = "median time, one solve", .logarithmic = true, .number = PlotNumber::kSeconds},
      .series = {}};
  std::set<double> sizes;
  for (const std::string& solver : facts.solvers) {
    std::map<double, double> curve;
    for (const ComparedPoint* each : facts.of_solver(solver)) {
      if (each->point.experiment != "scaling" || !each->is_solved()) continue;
      curve[static_cast<double>(each->point.candidates)] = each->point.seconds.median;
    }
    if (curve.empty()) continue;
    PlotSeries series = series_of(facts, solver);
    series.words = exponent_words(laws, solver);
    for (const auto& [size, seconds] : curve) {
      sizes.insert(size);
      series.x.push_back(size);
      series.y.push_back(seconds);
    }
    plot.series.push_back(std::move(series));
  }
  plot.x.ticks.assign(sizes.begin(), sizes.end());
  plot.caption = fmt::format(
      "Figure 3 of the paper, for every solver: nested subsets of one robot's positions, medians "
      "of the repetitions, only answers whose gap the checker confirmed. Beside the names: time as "
      "a power of Q for Q ≥ {}, with half of its 95 % interval.",
      kFitFrom);
  return plot;
}

ComparisonPlot performance_plot(const PageFacts& facts, const ProfileData& profile) {
  ComparisonPlot plot{.id = "performance-profile",
                      .title = "Performance profile: how often near the fastest",
                      .x = {.label = "times slower than the fastest", .logarithmic = true},
                      .y = {.label = "share of instances",
                            .number = PlotNumber::kShare,
                            .ticks = {0.0, 0.25, 0.5, 0.75, 1.0}},
                      .series = {},
                      .has_steps = true};
  const auto profiles = performance_profiles(profile.times);
  for (const std::string& solver : facts.solvers) {
    const auto at = std::ranges::find(profile.solvers, solver);
    if (at == profile.solvers.end()) continue;
    PlotSeries series = series_of(facts, solver);
    for (const ProfileStep& step :
         profiles[static_cast<std::size_t>(at - profile.solvers.begin())]) {
      series.x.push_back(step.tau);
      series.y.push_back(step.share);
    }
    if (series.x.empty()) continue;
    series.words = fmt::format("{:.0f} %", 100.0 * series.y.back());
    plot.series.push_back(std::move(series));
  }
  plot.caption = fmt::format(
      "Of {}, to a checked gap of {}: the share on which a solver takes at most so "
      "many times the time of the fastest (Dolan and Moré 2002). Higher is better. Beside the "
      "names: the share solved at all.",
      counted(profile.instances.size(), "instance"), gap_words(kProfileGap));
  return plot;
}

ComparisonPlot data_plot(const PageFacts& facts, const std::vector<std::string>& names,
                         const std::vector<std::vector<double>>& costs) {
  ComparisonPlot plot{.id = "data-profile",
                      .title = "Data profile: how much is solved in a given time",
                      .x = {.label = "time", .logarithmic = true, .number = PlotNumber::kSeconds},
                      .y = {.label = "share of instances",
                            .number = PlotNumber::kShare,
                            .ticks = {0.0, 0.25, 0.5, 0.75, 1.0}},
                      .series = {},
                      .has_steps = true};
  const auto profiles = data_profiles(costs);
  for (const std::string& solver : facts.solvers) {
    const auto at = std::ranges::find(names, solver);
    if (at == names.end()) continue;
    PlotSeries series = series_of(facts, solver);
    for (const BudgetStep& step : profiles[static_cast<std::size_t>(at - names.begin())]) {
      series.x.push_back(step.budget);
      series.y.push_back(step.share);
    }
    if (series.x.empty()) continue;
    series.words = fmt::format("{:.0f} %", 100.0 * series.y.back());
    plot.series.push_back(std::move(series));
  }
  plot.caption =
      "The same instances and times: the share that a solver has solved within a time (after Moré "
      "and Wild 2009). Higher and further left is better.";
  return plot;
}

ComparisonPlot passes_plot(const PageFacts& facts, const ProfileData& profile) {
  ComparisonPlot plot = data_plot(facts, profile.solvers, profile.passes);
  plot.id = "data-profile-passes";
  plot.title = "Data profile: how much is solved in so many passes over the set";
  plot.x = {.label = "passes over the set", .logarithmic = true};
  plot.caption =
      "The same with bytes read as the budget, in passes over the set: it depends on no machine. "
      "Programs that don't tell their passes are not drawn.";
  return plot;
}

}  // namespace

std::vector<ComparisonPlot> study_plots(const PageFacts& facts, const std::vector<SolverLaw>& laws,
                                        const ProfileData& profile) {
  std::vector<ComparisonPlot> plots;
  std::vector<ComparisonPlot> all{figure_3(facts, laws), performance_plot(facts, profile),
                                  data_plot(facts, profile.solvers, profile.times),
                                  passes_plot(facts, profile)};
  for (ComparisonPlot& plot : all) {
    if (!plot.series.empty()) plots.push_back(std::move(plot));
  }
  return plots;
}

}  // namespace graybox::bench
