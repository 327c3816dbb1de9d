#include "bench/study/summary.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "bench/study/environment.hpp"
#include "bench/study/tables.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.6g}", value) : std::string();
}

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

class Csv {
 public:
  explicit Csv(const std::vector<std::string>& header) { add(header); }
  void add(const std::vector<std::string>& cells) {
    for (std::size_t k = 0; k < cells.size(); ++k) {
      text_ += quoted(cells[k]);
      text_ += k + 1 < cells.size() ? ',' : '\n';
    }
  }
  void write(const fs::path& file) const { write_text_file(file.string(), text_); }

 private:
  std::string text_;
};

void write_points(const std::vector<PointSummary>& points, const fs::path& folder) {
  Csv csv({"experiment",
           "family",
           "candidates",
           "solver",
           "gap_asked",
           "status",
           "repetitions",
           "median_seconds",
           "lower_quartile_seconds",
           "upper_quartile_seconds",
           "charged_seconds",
           "checked_gap",
           "passes",
           "iterations",
           "support_size",
           "peak_memory_bytes",
           "added_memory_bytes",
           "solve_cpu_seconds",
           "stated_seconds",
           "repaired",
           "message"});
  for (const PointSummary& p : points) {
    csv.add({p.experiment,
             p.family,
             std::to_string(p.candidates),
             p.solver,
             number(p.gap_asked),
             std::string(to_string(p.status)),
             std::to_string(p.repetitions),
             number(p.seconds.median),
             number(p.seconds.lower),
             number(p.seconds.upper),
             number(p.charged_seconds),
             number(p.checked_gap),
             number(p.passes),
             number(p.iterations),
             std::to_string(p.support_size),
             number(p.peak_memory_bytes),
             number(p.added_memory_bytes),
             number(p.cpu_seconds),
             p.stated_seconds ? number(*p.stated_seconds) : "",
             number(p.repaired),
             p.message});
  }
  csv.write(folder / "points.csv");
}

void write_laws(const std::vector<SolverLaw>& laws, const fs::path& folder) {
  Csv csv({"solver", "exponent", "lower_95", "upper_95", "factor_seconds", "points",
           "from_candidates", "to_candidates", "exponent_per_iteration", "per_iteration_lower_95",
           "per_iteration_upper_95"});
  for (const SolverLaw& law : laws) {
    const PowerLaw each =
        law.per_iteration.value_or(PowerLaw{.exponent = std::numeric_limits<double>::infinity()});
    csv.add({law.solver, number(law.time.exponent), number(law.time.lower), number(law.time.upper),
             number(law.time.factor), std::to_string(law.time.points), std::to_string(law.from),
             std::to_string(law.to), number(each.exponent), number(each.lower),
             number(each.upper)});
  }
  csv.write(folder / "fitted_exponents.csv");
}

void write_time_to_gap(const std::vector<PointSummary>& points, const fs::path& folder) {
  Csv csv(
      {"experiment", "family", "candidates", "solver", "gap_asked", "gap", "seconds", "passes"});
  for (const PointSummary& p : points) {
    for (const auto& [level, at] : p.reached) {
      csv.add({p.experiment, p.family, std::to_string(p.candidates), p.solver, number(p.gap_asked),
               level, number(at.seconds), number(at.passes)});
    }
  }
  csv.write(folder / "time_to_gap.csv");
}

void write_own_clocks(const std::vector<PointSummary>& points, const fs::path& folder) {
  Csv csv({"experiment", "family", "candidates", "solver", "gap_asked", "gap", "stated_seconds"});
  for (const PointSummary& p : points) {
    for (const auto& [level, seconds] : p.stated_reached) {
      csv.add({p.experiment, p.family, std::to_string(p.candidates), p.solver, number(p.gap_asked),
               level, number(seconds)});
    }
  }
  csv.write(folder / "own_clock.csv");
}

void write_profiles(const std::vector<PointSummary>& points, const fs::path& folder) {
  const ProfileData data = profile_data(points);
  Csv instances({"instance", "solver", "seconds"});
  for (std::size_t s = 0; s < data.solvers.size(); ++s) {
    for (std::size_t i = 0; i < data.instances.size(); ++i) {
      instances.add({data.instances[i], data.solvers[s], number(data.times[s][i])});
    }
  }
  instances.write(folder / "profile_instances.csv");
  Csv profile({"solver", "tau", "share"});
  const auto profiles = performance_profiles(data.times);
  for (std::size_t s = 0; s < profiles.size(); ++s) {
    for (const ProfileStep& step : profiles[s]) {
      profile.add({data.solvers[s], number(step.tau), number(step.share)});
    }
  }
  profile.write(folder / "performance_profile.csv");
  Csv budgets({"solver", "budget", "within", "share"});
  const auto add = [&](const std::string& budget, const std::vector<std::vector<double>>& costs) {
    const auto steps = data_profiles(costs);
    for (std::size_t s = 0; s < steps.size(); ++s) {
      for (const BudgetStep& step : steps[s]) {
        budgets.add({data.solvers[s], budget, number(step.budget), number(step.share)});
      }
    }
  };
  add("seconds", data.times);
  add("passes", data.passes);
  budgets.write(folder / "data_profile.csv");
}

void write_mean_times(const std::vector<PointSummary>& points, const fs::path& folder) {
  Csv means({"gap", "solver", "solved", "instances", "shifted_geometric_mean_seconds",
             "shift_seconds", "charge_seconds"});
  for (const MeanTime& mean : mean_times(points)) {
    means.add({number(mean.gap), mean.solver, std::to_string(mean.solved),
               std::to_string(mean.instances), number(mean.seconds), number(kShift),
               number(mean.charge)});
  }
  means.write(folder / "mean_times.csv");
  Csv ratios(
      {"gap", "solver", "against", "ratio", "lower_95", "upper_95", "instances", "families"});
  for (const SolverRatio& each : solver_ratios(points)) {
    ratios.add({number(each.gap), each.solver, each.against, number(each.ratio.ratio),
                number(each.ratio.lower), number(each.ratio.upper),
                std::to_string(each.ratio.instances), std::to_string(each.ratio.groups)});
  }
  ratios.write(folder / "paired_ratios.csv");
}

void write_agreement(const std::vector<Agreement>& agreements, const fs::path& folder) {
  Csv csv({"family", "candidates", "answers", "log_det_spread", "worst_excess", "worst_pair",
           "agrees"});
  for (const Agreement& a : agreements) {
    csv.add({a.family, std::to_string(a.candidates), std::to_string(a.answers), number(a.spread),
             number(a.worst_excess), a.worst_pair, a.agrees() ? "yes" : "no"});
  }
  csv.write(folder / "agreement.csv");
}

void write_skips(const std::vector<SkipRow>& skips, const fs::path& folder) {
  Csv csv({"experiment", "family", "candidates", "solver", "gap_asked", "reason"});
  for (const SkipRow& s : skips) {
    csv.add({s.experiment, s.family, std::to_string(s.candidates), s.solver, number(s.duality_gap),
             s.reason});
  }
  csv.write(folder / "skipped.csv");
}

void write_headlines(const std::vector<Headline>& lines, const fs::path& folder) {
  Csv csv({"name", "value", "note"});
  for (const Headline& line : lines) csv.add({line.name, line.value, line.note});
  csv.write(folder / "headlines.csv");
}

std::string environment_text(const StudyRows& rows) {
  if (rows.environments.empty()) return "No environment was recorded.\n";
  const nlohmann::json& e = rows.environments.back();
  std::string text;
  for (const char* key : {"processor", "cores", "caches", "memory", "system", "kernel", "compiler",
                          "flags", "libraries", "kernels", "commit", "binary", "date", "load"}) {
    text += fmt::format("| {} | {} |\n", key, environment_words(e, key));
  }
  return fmt::format("| | |\n|---|---|\n{}| starts | {} |\n", text, rows.environments.size());
}

std::string status_counts(const std::vector<RunRow>& runs) {
  std::map<std::string, std::size_t> counts;
  for (const RunRow& run : runs) ++counts[std::string(to_string(run.status))];
  std::vector<std::string> parts;
  for (const auto& [status, count] : counts) parts.push_back(fmt::format("{} {}", count, status));
  return fmt::format("{}", fmt::join(parts, ", "));
}

// The median time, and that of an external program's own clock; or why there is none.
std::string time_text(const PointSummary& point) {
  if (point.status != ReportStatus::kSolved) return std::string(to_string(point.status));
  const std::string measured = fmt::format("{:.3g}", point.seconds.median);
  return point.stated_seconds
             ? fmt::format("{} ({:.3g} by its own clock)", measured, *point.stated_seconds)
             : measured;
}

// The solvers of an experiment: first those that solved most points, then the fastest in all.
std::vector<std::string> best_first(const std::vector<PointSummary>& points,
                                    const std::string& experiment) {
  std::map<std::string, std::pair<int, double>> scores;  // minus points solved, seconds charged
  for (const PointSummary& p : points) {
    if (p.experiment != experiment) continue;
    auto& [unsolved, seconds] = scores[p.solver];
    unsolved -= p.status == ReportStatus::kSolved ? 1 : 0;
    seconds += p.charged_seconds;
  }
  std::vector<std::string> names;
  for (const auto& [name, score] : scores) names.push_back(name);
  std::ranges::stable_sort(names, {}, [&](const std::string& name) { return scores.at(name); });
  return names;
}

// Solver against Q: the median time, or where and why it stopped.
std::string time_table(const std::vector<PointSummary>& points) {
  std::vector<std::size_t> sizes;
  const std::vector<std::string> solvers = best_first(points, "scaling");
  std::map<std::pair<std::string, std::size_t>, std::string> cells;
  for (const PointSummary& p : points) {
    if (p.experiment != "scaling") continue;
    if (std::ranges::find(sizes, p.candidates) == sizes.end()) sizes.push_back(p.candidates);
    cells[{p.solver, p.candidates}] = time_text(p);
  }
  std::ranges::sort(sizes);
  std::string text = "| solver |";
  for (const std::size_t size : sizes) text += fmt::format(" {} |", size);
  text += "\n|---|";
  for (std::size_t k = 0; k < sizes.size(); ++k) text += "---|";
  for (const std::string& solver : solvers) {
    text += fmt::format("\n| {} |", solver);
    for (const std::size_t size : sizes) {
      const auto cell = cells.find({solver, size});
      text += fmt::format(" {} |", cell == cells.end() ? "" : cell->second);
    }
  }
  return text + "\n";
}

std::string own_set_list(const std::vector<RunRow>& runs) {
  std::string text = "| set | Q | d | SHA-256 |\n|---|---|---|---|\n";
  std::vector<std::string> seen;
  for (const RunRow& run : runs) {
    if (run.key.experiment != "own") continue;
    if (std::ranges::find(seen, run.family) != seen.end()) continue;
    seen.push_back(run.family);
    text += fmt::format("| {} | {} | {} | {} |\n", run.family, run.candidates, run.dimension,
                        run.key.problem);
  }
  return text;
}

// Solver against own set: the median time, or why there is none.
std::string own_time_table(const std::vector<PointSummary>& points) {
  std::vector<std::string> sets;
  const std::vector<std::string> solvers = best_first(points, "own");
  std::map<std::pair<std::string, std::string>, std::string> cells;
  for (const PointSummary& p : points) {
    if (p.experiment != "own") continue;
    if (std::ranges::find(sets, p.family) == sets.end()) sets.push_back(p.family);
    cells[{p.solver, p.family}] = time_text(p);
  }
  std::string text = "| solver |", line = "\n|---|";
  for (const std::string& set : sets) {
    text += fmt::format(" {} |", fs::path(set).filename().string());
    line += "---|";
  }
  text += line;
  for (const std::string& solver : solvers) {
    text += fmt::format("\n| {} |", solver);
    for (const std::string& set : sets) {
      const auto cell = cells.find({solver, set});
      text += fmt::format(" {} |", cell == cells.end() ? "" : cell->second);
    }
  }
  return text + "\n";
}

std::string law_table(const std::vector<SolverLaw>& laws) {
  std::string text = "| solver | exponent | 95 % confidence | Q |\n|---|---|---|---|\n";
  for (const SolverLaw& law : laws) {
    const bool bounded = std::isfinite(law.time.lower);
    text += fmt::format("| {} | {:.2f} | {} | {} to {} |\n", law.solver, law.time.exponent,
                        bounded ? fmt::format("{:.2f} to {:.2f}", law.time.lower, law.time.upper)
                                : "two points only",
                        law.from, law.to);
  }
  return text;
}

std::string agreement_text(const std::vector<Agreement>& agreements) {
  std::string text;
  for (const Agreement& a : agreements) {
    if (a.agrees()) continue;
    text += fmt::format("**{} Q = {}: {} differ by {:.1e} more than their bounds.**\n", a.family,
                        a.candidates, a.worst_pair, a.worst_excess);
  }
  if (!text.empty()) return text;
  double spread = 0.0;
  for (const Agreement& a : agreements) spread = std::max(spread, a.spread);
  return fmt::format(
      "{} A bound is d log(1 + gap); the solved answers differ by at most {:.1e} in log det.\n",
      agreement_words(agreements), spread);
}

// "1e-6".
std::string gap_text(double gap) { return fmt::format("1e-{}", std::lround(-std::log10(gap))); }

// Solver against gap, the fastest at kProfileGap first: the shifted mean, and how many instances it
// solved where not all.
std::string mean_table(std::vector<MeanTime> means) {
  std::ranges::stable_sort(means, {}, &MeanTime::seconds);
  std::map<std::pair<std::string, double>, std::string> cells;
  std::vector<std::string> solvers;
  for (const MeanTime& mean : means) {
    if (mean.gap == kProfileGap) solvers.push_back(mean.solver);
    cells[{mean.solver, mean.gap}] =
        mean.solved == mean.instances
            ? fmt::format("{:.3g}", mean.seconds)
            : fmt::format("{:.3g} ({} of {})", mean.seconds, mean.solved, mean.instances);
  }
  std::string text = "| solver |", line = "\n|---|";
  for (const double gap : kComparedGaps) {
    text += fmt::format(" {} |", gap_text(gap));
    line += "---|";
  }
  text += line;
  for (const std::string& solver : solvers) {
    text += fmt::format("\n| {} |", solver);
    for (const double gap : kComparedGaps) {
      const auto cell = cells.find({solver, gap});
      text += fmt::format(" {} |", cell == cells.end() ? "" : cell->second);
    }
  }
  return text + "\n";
}

// How many times longer the others take than the default back-end.
std::string ratio_table(const std::vector<SolverRatio>& ratios) {
  std::string text =
      "| solver | gap | ratio | 95 % interval | solved by both | families |\n"
      "|---|---|---|---|---|---|\n";
  for (const SolverRatio& each : ratios) {
    const PairedRatio& r = each.ratio;
    text += fmt::format("| {} | {} | {:.3g} | {} | {} | {} |\n", each.solver, gap_text(each.gap),
                        r.ratio,
                        std::isfinite(r.upper) ? fmt::format("{:.3g} to {:.3g}", r.lower, r.upper)
                                               : "one family only",
                        r.instances, r.groups);
  }
  return text;
}

// Where solvers fail: how often each and how, with the first such point.
std::string failure_table(const std::vector<PointSummary>& points) {
  std::map<std::pair<std::string, std::string>, std::pair<std::size_t, std::string>> found;
  for (const PointSummary& p : points) {
    if (p.status == ReportStatus::kSolved || p.experiment == "normalisation") continue;
    auto& [count, first] = found[{p.solver, std::string(to_string(p.status))}];
    if (count++ == 0)
      first = fmt::format("{} Q = {}, gap {:.0e}", p.family, p.candidates, p.gap_asked);
  }
  if (found.empty()) return "Every solver solved every point that it was run on.\n";
  std::string text = "| solver | status | points | the first |\n|---|---|---|---|\n";
  for (const auto& [key, value] : found) {
    text +=
        fmt::format("| {} | {} | {} | {} |\n", key.first, key.second, value.first, value.second);
  }
  return text;
}

bool has_points(const std::vector<PointSummary>& points, const std::string& experiment) {
  return std::ranges::find(points, experiment, &PointSummary::experiment) != points.end();
}

std::string summary_text(const StudyRows& rows, const std::vector<PointSummary>& points,
                         const std::vector<SolverLaw>& laws,
                         const std::vector<Agreement>& agreements,
                         const std::vector<Headline>& lines) {
  std::string text = fmt::format("# Study\n\n{}: {}; {} not run (tables/skipped.csv).\n",
                                 counted(rows.runs.size(), "run"), status_counts(rows.runs),
                                 counted(rows.skips.size(), "point"));
  if (!lines.empty()) text += "\n## Headlines\n\n| | | |\n|---|---|---|\n";
  for (const Headline& line : lines) {
    text += fmt::format("| {} | {} | {} |\n", line.name, line.value, line.note);
  }
  text += "\n## Agreement\n\n" + agreement_text(agreements);
  if (has_points(points, "own")) {
    text += "\n## Own sets: median seconds to the gap asked\n\n" + own_time_table(points) + "\n" +
            own_set_list(rows.runs);
  }
  if (has_points(points, "scaling")) {
    text += "\n## Robot set: median seconds to the gap asked, against Q\n\n" + time_table(points);
    text += fmt::format("\n## Fitted exponents of time against Q, Q >= {}\n\n", kFitFrom) +
            law_table(laws);
  }
  text += fmt::format(
              "\n## Mean seconds to equal accuracy\n\nGeometric means, shifted by {} s; what was "
              "not solved or not run is charged ten times the longest time "
              "(tables/mean_times.csv).\n\n",
              kShift) +
          mean_table(mean_times(points));
  if (const auto ratios = ratios_against(kDefaultSolver, solver_ratios(points)); !ratios.empty()) {
    text += fmt::format("\n## Times longer than {}\n\n", kDefaultSolver) + ratio_table(ratios);
  }
  text += "\n## Where solvers fail\n\n" + failure_table(points);
  if (const std::vector<AbsentSolver> absent = absent_of(rows); !absent.empty()) {
    text += "\n## Solvers that are not here\n\n| solver | needs |\n|---|---|\n";
    for (const AbsentSolver& each : absent) {
      text += fmt::format("| {} | {} |\n", each.name, each.needs);
    }
  }
  text += "\n## Environment\n\n" + environment_text(rows);
  return text;
}

}  // namespace

std::string write_tables(const StudyRows& rows, const fs::path& folder) {
  const std::vector<PointSummary> points = summarise_points(rows.runs);
  const std::vector<SolverLaw> laws = fit_laws(points);
  const std::vector<Agreement> agreements = check_agreement(rows.runs);
  const std::vector<Headline> lines = headlines(points);
  const fs::path tables = folder / "tables";
  fs::create_directories(tables);
  FilesTogether files;
  write_points(points, tables);
  write_laws(laws, tables);
  write_time_to_gap(points, tables);
  write_own_clocks(points, tables);
  write_profiles(points, tables);
  write_mean_times(points, tables);
  write_agreement(agreements, tables);
  write_headlines(lines, tables);
  write_skips(rows.skips, tables);
  std::string summary = summary_text(rows, points, laws, agreements, lines);
  write_text_file((folder / "summary.md").string(), summary);
  files.commit();
  return summary;
}

}  // namespace graybox::bench
