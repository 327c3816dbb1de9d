#include "bench/study/tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "bench/study/plan.hpp"

namespace graybox::bench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <typename Range, typename Get>
double median_of(const Range& range, Get get) {
  std::vector<double> values;
  for (const auto& item : range) values.push_back(get(*item));
  return quartiles(std::move(values)).median;
}

using RunGroup = std::vector<const RunRow*>;

std::vector<RunGroup> group_by_point(const std::vector<RunRow>& runs) {
  std::map<std::tuple<std::string, std::string, std::size_t, std::string, double>, std::size_t>
      places;
  std::vector<RunGroup> groups;
  for (const RunRow& run : runs) {
    const auto [place, is_new] = places.try_emplace(
        {run.key.experiment, run.family, run.candidates, run.key.solver, run.key.duality_gap},
        groups.size());
    if (is_new) groups.emplace_back();
    groups[place->second].push_back(&run);
  }
  return groups;
}

std::map<std::string, GapReached> median_reached(const RunGroup& group) {
  std::map<std::string, GapReached> medians;
  for (const auto& [level, ignored] : group.front()->reached) {
    const auto has = [&, &name = level](const RunRow* run) { return run->reached.contains(name); };
    if (!std::ranges::all_of(group, has)) continue;
    const auto& name = level;
    medians[level] = {
        median_of(group, [&](const RunRow& run) { return run.reached.at(name).seconds; }),
        median_of(group, [&](const RunRow& run) { return run.reached.at(name).passes; })};
  }
  return medians;
}

// What an external program said, and what its weights needed.
void add_account(const RunGroup& group, PointSummary& point) {
  const RunRow& first = *group.front();
  if (std::ranges::all_of(group,
                          [](const RunRow* run) { return run->account.seconds.has_value(); })) {
    point.stated_seconds = median_of(group, [](const RunRow& run) { return *run.account.seconds; });
  }
  for (const auto& [level, at] :
       gaps_reached(first.account.trace, first.duality_gap, first.rounding_bound)) {
    point.stated_reached[level] = at.seconds;
  }
  for (const RunRow* run : group) {
    point.repaired =
        std::max({point.repaired, run->repair.clipped, std::abs(run->repair.rescaled)});
  }
}

PointSummary summarise(const RunGroup& group) {
  const RunRow& first = *group.front();
  PointSummary point;
  point.experiment = first.key.experiment;
  point.family = first.family;
  point.candidates = first.candidates;
  point.solver = first.key.solver;
  point.gap_asked = first.key.duality_gap;
  point.repetitions = group.size();
  const auto failed = std::ranges::find_if(
      group, [](const RunRow* run) { return run->status != ReportStatus::kSolved; });
  const RunRow& telling = failed == group.end() ? first : **failed;
  point.status = telling.status;
  point.message = telling.message;
  std::vector<double> seconds;
  for (const RunRow* run : group) {
    seconds.push_back(run->seconds);
    point.checked_gap = std::max(point.checked_gap, run->duality_gap);
    point.peak_memory_bytes =
        std::max(point.peak_memory_bytes, static_cast<double>(run->peak_memory_bytes));
  }
  point.seconds = quartiles(std::move(seconds));
  point.charged_seconds =
      point.status == ReportStatus::kSolved ? point.seconds.median : first.key.time_limit;
  point.passes = median_of(group, [](const RunRow& run) { return run.passes; });
  point.iterations =
      median_of(group, [](const RunRow& run) { return static_cast<double>(run.iterations); });
  point.added_memory_bytes = median_of(group, [](const RunRow& run) {
    return static_cast<double>(run.peak_memory_bytes) -
           static_cast<double>(std::min(run.baseline_memory_bytes, run.peak_memory_bytes));
  });
  point.cpu_seconds = median_of(group, [](const RunRow& run) { return run.solve_cpu_seconds; });
  add_account(group, point);
  point.support_size = first.support_size;
  point.reached = median_reached(group);
  return point;
}

bool is_solved_scaling(const PointSummary& point) {
  return point.experiment == "scaling" && point.status == ReportStatus::kSolved;
}

// Median seconds against Q of one solver in the scaling experiment.
std::map<std::size_t, double> scaling_curve(const std::vector<PointSummary>& points,
                                            const std::string& solver) {
  std::map<std::size_t, double> curve;
  for (const PointSummary& point : points) {
    if (is_solved_scaling(point) && point.solver == solver) {
      curve[point.candidates] = point.seconds.median;
    }
  }
  return curve;
}

struct CommonCurves {
  std::vector<double> sizes, first, second;
};

CommonCurves common_curves(const std::vector<PointSummary>& points, const std::string& first,
                           const std::string& second) {
  const auto a = scaling_curve(points, first);
  const auto b = scaling_curve(points, second);
  CommonCurves common;
  for (const auto& [size, seconds] : a) {
    if (!b.contains(size)) continue;
    common.sizes.push_back(static_cast<double>(size));
    common.first.push_back(seconds);
    common.second.push_back(b.at(size));
  }
  return common;
}

bool took_part(const std::vector<PointSummary>& points, const std::string& solver) {
  return std::ranges::find(points, solver, &PointSummary::solver) != points.end();
}

void add_ratio(std::vector<Headline>& lines, const std::vector<PointSummary>& points,
               const std::string& slow, const std::string& fast, const std::string& note) {
  if (!took_part(points, slow) || !took_part(points, fast)) return;
  const CommonCurves common = common_curves(points, slow, fast);
  const std::string name = slow + " / " + fast;
  if (common.sizes.empty()) {
    lines.push_back({name, "not measured", "no Q at which both were solved"});
    return;
  }
  double logarithms = 0.0;
  std::size_t count = 0;
  for (std::size_t k = 0; k < common.sizes.size(); ++k) {
    if (common.sizes[k] < static_cast<double>(kFitFrom)) continue;
    logarithms += std::log(common.first[k] / common.second[k]);
    ++count;
  }
  lines.push_back({name, fmt::format("{:.3g}", common.first.back() / common.second.back()),
                   fmt::format("time ratio at Q = {:.0f}{}{}", common.sizes.back(),
                               note.empty() ? "" : "; ", note)});
  if (count > 1) {
    lines.push_back({name + ", mean",
                     fmt::format("{:.3g}", std::exp(logarithms / static_cast<double>(count))),
                     fmt::format("geometric mean over Q >= {}", kFitFrom)});
  }
}

void add_crossover(std::vector<Headline>& lines, const std::vector<PointSummary>& points,
                   const std::string& primal, const std::string& dual) {
  if (!took_part(points, primal) || !took_part(points, dual)) return;
  const CommonCurves common = common_curves(points, primal, dual);
  const std::string name = fmt::format("crossover {} / {}", primal, dual);
  if (common.sizes.size() < 2) {
    lines.push_back({name, "not measured", "fewer than two Q at which both were solved"});
    return;
  }
  const auto at = crossover(common.sizes, common.first, common.second);
  if (!at) {
    lines.push_back(
        {name, "none", fmt::format("the primal is faster up to Q = {:.0f}", common.sizes.back())});
  } else if (*at <= common.sizes.front()) {
    lines.push_back({name, fmt::format("below {:.0f}", common.sizes.front()),
                     "the dual is faster from the smallest Q on"});
  } else {
    lines.push_back({name, fmt::format("{:.0f}", *at), "Q from which the dual is faster"});
  }
}

// The answers compared for agreement: one a solver and gap, certified.
std::string pair_name(const RunRow& a, const RunRow& b) {
  return a.key.solver + ", " + b.key.solver;
}

double excess(const RunRow& a, const RunRow& b) {
  const auto d = static_cast<double>(a.dimension);
  const auto bound = [&](const RunRow& run) {
    return d * std::log1p(std::max(run.duality_gap, 0.0) + run.rounding_bound);
  };
  const double rounding = 1e-13 * (d + std::abs(a.log_det));  // of log det itself
  return std::abs(a.log_det - b.log_det) - bound(a) - bound(b) - rounding;
}

GapReached cost_to_gap(const PointSummary& point, double gap) {
  const std::string level = fmt::format("1e-{}", std::lround(-std::log10(gap)));
  if (const auto at = point.reached.find(level); at != point.reached.end()) return at->second;
  const bool reached = point.checked_gap <= gap || point.status == ReportStatus::kSolved;
  if (!reached || point.gap_asked > gap) return {kInfinity, kInfinity};
  return {point.seconds.median, point.passes};
}

// Points of the profiles, see ProfileData.
std::vector<const PointSummary*> profile_points(const std::vector<PointSummary>& points) {
  const auto is_nested = [](const PointSummary& p) { return p.experiment == "scaling"; };
  const auto is_left_out = [](const PointSummary& p) { return p.experiment == "normalisation"; };
  const bool any_else = std::ranges::any_of(
      points, [&](const PointSummary& p) { return !is_nested(p) && !is_left_out(p); });
  std::vector<const PointSummary*> chosen;
  for (const PointSummary& point : points) {
    if (!is_left_out(point) && !(any_else && is_nested(point))) chosen.push_back(&point);
  }
  return chosen;
}

// Draws and sizes of one family are no independent families.
std::string group_name(const PointSummary& point) {
  return point.experiment == "own" ? point.family : study_set_name(point.family).family;
}

}  // namespace

std::vector<PointSummary> summarise_points(const std::vector<RunRow>& runs) {
  std::vector<PointSummary> points;
  for (const RunGroup& group : group_by_point(runs)) points.push_back(summarise(group));
  return points;
}

std::vector<SolverLaw> fit_laws(const std::vector<PointSummary>& points) {
  std::vector<std::string> solvers;
  for (const PointSummary& point : points) {
    if (std::ranges::find(solvers, point.solver) == solvers.end()) solvers.push_back(point.solver);
  }
  std::vector<SolverLaw> laws;
  for (const std::string& solver : solvers) {
    std::vector<double> sizes, seconds, each;
    for (const PointSummary& point : points) {
      if (!is_solved_scaling(point) || point.solver != solver || point.candidates < kFitFrom) {
        continue;
      }
      sizes.push_back(static_cast<double>(point.candidates));
      seconds.push_back(point.seconds.median);
      if (point.iterations > 0.0) each.push_back(point.seconds.median / point.iterations);
    }
    const auto law = fit_power_law(sizes, seconds);
    if (!law) continue;
    const auto [from, to] = std::ranges::minmax(sizes);
    laws.push_back({solver, *law,
                    each.size() == sizes.size() ? fit_power_law(sizes, each) : std::nullopt,
                    static_cast<std::size_t>(from), static_cast<std::size_t>(to)});
  }
  return laws;
}

ProfileData profile_data(const std::vector<PointSummary>& points, double gap) {
  std::map<std::string, std::map<std::string, GapReached>> table;
  ProfileData data;
  std::vector<std::string> families;
  const auto note = [](std::vector<std::string>& list, const std::string& name) {
    if (std::ranges::find(list, name) == list.end()) list.push_back(name);
  };
  constexpr GapReached kNever{kInfinity, kInfinity};
  for (const PointSummary* point : profile_points(points)) {
    const std::string instance = fmt::format("{}/{}", point->family, point->candidates);
    note(data.solvers, point->solver);
    note(families, group_name(*point));
    if (std::ranges::find(data.instances, instance) == data.instances.end()) {
      data.instances.push_back(instance);
      const auto family = std::ranges::find(families, group_name(*point)) - families.begin();
      data.groups.push_back(static_cast<std::size_t>(family));
    }
    GapReached& best = table[point->solver].try_emplace(instance, kNever).first->second;
    if (const GapReached cost = cost_to_gap(*point, gap); cost.seconds < best.seconds) best = cost;
  }
  for (const std::string& solver : data.solvers) {
    std::vector<double>& times = data.times.emplace_back();
    std::vector<double>& passes = data.passes.emplace_back();
    for (const std::string& instance : data.instances) {
      const auto at = table[solver].find(instance);
      const GapReached cost = at == table[solver].end() ? kNever : at->second;
      times.push_back(cost.seconds);
      passes.push_back(cost.passes > 0.0 ? cost.passes : kInfinity);
    }
  }
  return data;
}

std::vector<MeanTime> mean_times(const std::vector<PointSummary>& points) {
  std::vector<MeanTime> means;
  for (const double gap : kComparedGaps) {
    const ProfileData data = profile_data(points, gap);
    double longest = 0.0;
    for (const auto& row : data.times) {
      for (const double time : row)
        longest = std::isfinite(time) ? std::max(longest, time) : longest;
    }
    if (longest == 0.0) continue;
    const auto add = [&](const std::string& solver, const std::vector<double>& times) {
      const auto finite = [](double time) { return std::isfinite(time); };
      means.push_back({.solver = solver,
                       .gap = gap,
                       .solved = static_cast<std::size_t>(std::ranges::count_if(times, finite)),
                       .instances = times.size(),
                       .charge = 10.0 * longest,
                       .seconds = shifted_geometric_mean(times, kShift, 10.0 * longest)});
    };
    add(kVirtualBest, virtual_best(data.times));
    for (std::size_t s = 0; s < data.solvers.size(); ++s) add(data.solvers[s], data.times[s]);
  }
  return means;
}

std::vector<SolverRatio> solver_ratios(const std::vector<PointSummary>& points) {
  std::vector<SolverRatio> ratios;
  for (const double gap : kComparedGaps) {
    const ProfileData data = profile_data(points, gap);
    const auto add = [&](std::size_t s, const std::string& against,
                         const std::vector<double>& times) {
      const auto ratio = paired_ratio(data.times[s], times, data.groups);
      if (ratio) {
        ratios.push_back(
            {.gap = gap, .solver = data.solvers[s], .against = against, .ratio = *ratio});
      }
    };
    const std::vector<double> best = virtual_best(data.times);
    for (std::size_t s = 0; s < data.solvers.size(); ++s) {
      add(s, kVirtualBest, best);
      for (std::size_t t = s + 1; t < data.solvers.size(); ++t) {
        add(s, data.solvers[t], data.times[t]);
      }
    }
  }
  return ratios;
}

std::vector<SolverRatio> ratios_against(const std::string& solver,
                                        const std::vector<SolverRatio>& ratios) {
  std::vector<SolverRatio> turned;
  for (SolverRatio each : ratios) {
    if (each.solver == solver && each.against != kVirtualBest) {
      std::swap(each.solver, each.against);
      PairedRatio& r = each.ratio;
      r = {1.0 / r.ratio, 1.0 / r.upper, 1.0 / r.lower, r.instances, r.groups};
    }
    if (each.against == solver) turned.push_back(std::move(each));
  }
  return turned;
}

std::vector<Agreement> check_agreement(const std::vector<RunRow>& runs) {
  std::map<std::string, std::vector<const RunRow*>> answers;  // by problem
  std::vector<std::string> order;
  for (const RunRow& run : runs) {
    if (!std::isfinite(run.duality_gap) || run.key.repetition != 0) continue;
    auto& list = answers[run.key.problem];
    if (list.empty()) order.push_back(run.key.problem);
    list.push_back(&run);
  }
  std::vector<Agreement> agreements;
  for (const std::string& problem : order) {
    const auto& list = answers.at(problem);
    Agreement agreement{
        list.front()->family, list.front()->candidates, list.size(), 0.0, -kInfinity, ""};
    for (std::size_t i = 0; i < list.size(); ++i) {
      for (std::size_t j = i + 1; j < list.size(); ++j) {
        const RunRow &a = *list[i], &b = *list[j];
        if (a.status == ReportStatus::kSolved && b.status == ReportStatus::kSolved) {
          agreement.spread = std::max(agreement.spread, std::abs(a.log_det - b.log_det));
        }
        if (const double beyond = excess(a, b); beyond > agreement.worst_excess) {
          agreement.worst_excess = beyond;
          agreement.worst_pair = pair_name(a, b);
        }
      }
    }
    agreements.push_back(std::move(agreement));
  }
  return agreements;
}

std::string agreement_words(const std::vector<Agreement>& agreements) {
  const auto disagrees = [](const Agreement& each) { return !each.agrees(); };
  if (const auto first = std::ranges::find_if(agreements, disagrees); first != agreements.end()) {
    return fmt::format("Certified answers disagree: {}, Q = {}.", first->family, first->candidates);
  }
  const auto compared = static_cast<std::size_t>(
      std::ranges::count_if(agreements, [](const Agreement& each) { return each.answers > 1; }));
  if (compared == 0) return "No problem has two certified answers, which could be compared.";
  return fmt::format(
      "All certified answers to {} agree within their proven bounds.",
      compared == 1 ? "the one problem" : fmt::format("each of the {} problems", compared));
}

std::string counted(std::size_t count, const std::string& noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

std::vector<AbsentSolver> absent_of(const StudyRows& rows) {
  if (rows.environments.empty()) return {};
  std::vector<AbsentSolver> absent = absent_solvers(rows.environments.back());
  std::erase_if(absent, [&](const AbsentSolver& each) {
    return std::ranges::any_of(rows.runs,
                               [&](const RunRow& run) { return run.key.solver == each.name; });
  });
  return absent;
}

std::vector<Headline> headlines(const std::vector<PointSummary>& points) {
  std::vector<Headline> lines;
  if (std::ranges::find(points, "scaling", &PointSummary::experiment) == points.end()) return {};
  add_ratio(lines, points, "dual_interior_point_sparse", "dual_interior_point",
            "the paper reports about 4");
  add_crossover(lines, points, "primal_interior_point", "dual_interior_point");
  add_ratio(lines, points, "primal_interior_point", "dual_interior_point", "");
  add_ratio(lines, points, "dual_interior_point", "column_generation", "");
  add_ratio(lines, points, "primal_interior_point", "primal_interior_point_low_rank", "");
  return lines;
}

}  // namespace graybox::bench
