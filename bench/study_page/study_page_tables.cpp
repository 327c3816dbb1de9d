#include "bench/study_page/study_page_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "bench/study/environment.hpp"
#include "bench/study/progress.hpp"

namespace graybox::bench {
namespace {

constexpr double kMegabyte = 1e6;

std::vector<PageCell> point_row(const ComparedPoint& each, bool names_solver) {
  const PointSummary& point = each.point;
  std::vector<PageCell> row;
  if (names_solver) row.push_back({point.solver});
  row.push_back({point.experiment});
  row.push_back({point.family});
  row.push_back(count_cell(point.candidates));
  PageCell status = status_cell(point.status);
  status.note = point.message;
  row.push_back(std::move(status));
  row.push_back(seconds_cell(point.seconds.median));
  row.push_back({.text = point.repetitions > 1
                             ? fmt::format("{} to {}", seconds_cell(point.seconds.lower).text,
                                           seconds_cell(point.seconds.upper).text)
                             : std::string("–"),
                 .order = point.seconds.upper - point.seconds.lower});
  row.push_back(number_cell(each.ratio));
  row.push_back(PageCell{.text = gap_words(point.gap_asked), .order = point.gap_asked});
  row.push_back(number_cell(point.checked_gap, 2));
  row.push_back(number_cell(point.passes));
  row.push_back(number_cell(point.added_memory_bytes / kMegabyte, 2));
  row.push_back(count_cell(point.repetitions));
  return row;
}

struct SolverCounts {
  std::size_t points = 0, solved = 0, fastest = 0, within_two = 0;
};

SolverCounts counts_of(const std::vector<const ComparedPoint*>& points) {
  SolverCounts counts;
  for (const ComparedPoint* each : points) {
    ++counts.points;
    if (!each->is_solved()) continue;
    ++counts.solved;
    counts.fastest += each->ratio <= 1.0 ? 1U : 0U;
    counts.within_two += each->ratio <= 2.0 ? 1U : 0U;
  }
  return counts;
}

// The geometric mean of the ratios to the fastest, over what was solved.
double mean_ratio(const std::vector<const ComparedPoint*>& points) {
  double logarithms = 0.0;
  std::size_t count = 0;
  for (const ComparedPoint* each : points) {
    if (!std::isfinite(each->ratio)) continue;
    logarithms += std::log(each->ratio);
    ++count;
  }
  return count == 0 ? std::numeric_limits<double>::quiet_NaN()
                    : std::exp(logarithms / static_cast<double>(count));
}

PageCell exponent_cell(const std::vector<SolverLaw>& laws, const std::string& solver) {
  const auto law = std::ranges::find(laws, solver, &SolverLaw::solver);
  if (law == laws.end()) return {"–"};
  PageCell cell{.text = fmt::format("{:.2f}", law->time.exponent), .order = law->time.exponent};
  if (std::isfinite(law->time.upper)) {
    cell.note = fmt::format("{:.2f} to {:.2f}", law->time.lower, law->time.upper);
  }
  return cell;
}

}  // namespace

PageTable points_table(const std::string& caption, const std::vector<const ComparedPoint*>& points,
                       bool names_solver) {
  PageTable table{.caption = caption, .columns = {}, .rows = {}, .is_sortable = true};
  if (names_solver) table.columns.push_back({"solver", false, true});
  for (const PageTable::Column& column :
       std::initializer_list<PageTable::Column>{{"experiment", false, true},
                                                {"set", false, true},
                                                {"Q", true},
                                                {"status", false, true},
                                                {"median time", true},
                                                {"quartiles", true},
                                                {"times the fastest", true},
                                                {"gap asked", true},
                                                {"gap found", true},
                                                {"passes", true},
                                                {"memory added, MB", true},
                                                {"runs", true}}) {
    table.columns.push_back(column);
  }
  for (const ComparedPoint* each : points) table.rows.push_back(point_row(*each, names_solver));
  return table;
}

PageTable solvers_table(const PageFacts& facts, const std::vector<SolverLaw>& laws) {
  PageTable table{.caption = "Solvers in short, the normalisation experiment left out",
                  .columns = {{"solver"},
                              {"points solved", true},
                              {"of", true},
                              {"fastest on", true},
                              {"within twice the fastest", true},
                              {"times the fastest, mean", true},
                              {"time as Q to the power", true}},
                  .rows = {},
                  .is_sortable = true};
  for (const std::string& solver : facts.solvers) {
    std::vector<const ComparedPoint*> points = facts.of_solver(solver);
    // The normalisation experiment is about scaling, between two forms of one solver.
    std::erase_if(points, [](const ComparedPoint* each) {
      return each->point.experiment == "normalisation";
    });
    if (points.empty()) continue;
    const SolverCounts counts = counts_of(points);
    table.rows.push_back({{solver},
                          count_cell(counts.solved),
                          count_cell(counts.points),
                          count_cell(counts.fastest),
                          count_cell(counts.within_two),
                          number_cell(mean_ratio(points)),
                          exponent_cell(laws, solver)});
  }
  return table;
}

PageTable headlines_table(const std::vector<Headline>& lines) {
  PageTable table{"Headlines", {{"what"}, {"value", true}, {"note"}}, {}};
  for (const Headline& line : lines) table.rows.push_back({{line.name}, {line.value}, {line.note}});
  return table;
}

PageTable agreement_table(const std::vector<Agreement>& agreements) {
  PageTable table{
      .caption = "Do the certified answers to one problem agree?",
      .columns = {{"set"}, {"Q", true}, {"answers", true}, {"spread of log det", true}, {"agree?"}},
      .rows = {},
      .is_sortable = true};
  for (const Agreement& each : agreements) {
    table.rows.push_back({{each.family},
                          count_cell(each.candidates),
                          count_cell(each.answers),
                          number_cell(each.spread, 2),
                          {.text = each.agrees() ? "yes" : "no",
                           .note = each.agrees() ? std::string() : each.worst_pair,
                           .mark = each.agrees() ? PageMark::kPassed : PageMark::kFailed}});
  }
  return table;
}

PageTable absent_table(const std::vector<AbsentSolver>& absent) {
  PageTable table{"Solvers that are not installed here", {{"solver"}, {"needs"}}, {}};
  for (const AbsentSolver& each : absent) table.rows.push_back({{each.name}, {each.needs}});
  return table;
}

PageTable skips_table(const std::vector<SkipRow>& skips) {
  PageTable table{.caption = "Points that were not run",
                  .columns = {{"solver", false, true},
                              {"experiment", false, true},
                              {"set", false, true},
                              {"Q", true},
                              {"why"}},
                  .rows = {},
                  .is_sortable = true};
  for (const SkipRow& skip : skips) {
    table.rows.push_back({{skip.solver},
                          {skip.experiment},
                          {skip.family},
                          count_cell(skip.candidates),
                          {skip.reason}});
  }
  return table;
}

PageTable environment_table(const StudyRows& rows) {
  PageTable table{"Where it was measured", {{"what"}, {"value"}}, {}};
  double seconds = 0.0;
  for (const RunRow& run : rows.runs) seconds += run.process_seconds;
  table.rows.push_back({{"time of all runs"}, {readable_duration(seconds)}});
  if (rows.environments.empty()) return table;
  const nlohmann::json& last = rows.environments.back();
  constexpr std::array kKeys{"command", "date",   "processor", "cores",     "caches",
                             "memory",  "system", "kernel",    "compiler",  "flags",
                             "kernels", "load",   "commit",    "libraries", "binary"};
  for (const char* key : kKeys) {
    if (last.contains(key)) table.rows.push_back({{key}, {environment_words(last, key)}});
  }
  table.rows.push_back({{"starts"}, {std::to_string(rows.environments.size())}});
  return table;
}

}  // namespace graybox::bench
