#include "bench/study_page/comparison_tables.hpp"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>

namespace graybox::bench {
namespace {

PageCell gap_cell(double gap) { return {.text = gap_words(gap), .order = gap}; }

// The normalisation experiment is about scaling, between two forms of one solver.
std::vector<const ComparedPoint*> comparable(const PageFacts& facts) {
  std::vector<const ComparedPoint*> points;
  for (const ComparedPoint& each : facts.points) {
    if (each.point.experiment != "normalisation") points.push_back(&each);
  }
  return points;
}

PageCell interval_cell(const PairedRatio& ratio) {
  if (!std::isfinite(ratio.upper)) return {"–"};
  return {.text = fmt::format("{:.3g} to {:.3g}", ratio.lower, ratio.upper),
          .order = ratio.upper / ratio.lower};
}

}  // namespace

PageTable means_table(const std::vector<MeanTime>& means) {
  PageTable table{.caption = "Mean times to equal accuracy",
                  .columns = {{"solver", false, true},
                              {"gap", false, true},
                              {"mean time", true},
                              {"solved", true},
                              {"of", true},
                              {"charge for others", true}},
                  .rows = {},
                  .is_sortable = true};
  for (const MeanTime& each : means) {
    table.rows.push_back({{each.solver},
                          gap_cell(each.gap),
                          seconds_cell(each.seconds),
                          count_cell(each.solved),
                          count_cell(each.instances),
                          seconds_cell(each.charge)});
  }
  return table;
}

PageTable ratios_table(const std::vector<SolverRatio>& ratios) {
  PageTable table{.caption = "How many times longer one solver takes than another",
                  .columns = {{"solver", false, true},
                              {"against", false, true},
                              {"gap", false, true},
                              {"ratio of times", true},
                              {"95 % interval", true},
                              {"solved by both", true},
                              {"families", true}},
                  .rows = {},
                  .is_sortable = true};
  for (const SolverRatio& each : ratios) {
    table.rows.push_back({{each.solver},
                          {each.against},
                          gap_cell(each.gap),
                          number_cell(each.ratio.ratio),
                          interval_cell(each.ratio),
                          count_cell(each.ratio.instances),
                          count_cell(each.ratio.groups)});
  }
  return table;
}

PageTable failures_table(const PageFacts& facts) {
  PageTable table{.caption = "Points that were not solved",
                  .columns = {{"solver", false, true},
                              {"experiment", false, true},
                              {"set", false, true},
                              {"Q", true},
                              {"status", false, true},
                              {"gap asked", true},
                              {"gap found", true},
                              {"after", true}},
                  .rows = {},
                  .is_sortable = true};
  for (const ComparedPoint* each : comparable(facts)) {
    if (each->is_solved()) continue;
    const PointSummary& point = each->point;
    PageCell status = status_cell(point.status);
    status.note = point.message;
    table.rows.push_back({{point.solver},
                          {point.experiment},
                          {point.family},
                          count_cell(point.candidates),
                          std::move(status),
                          gap_cell(point.gap_asked),
                          number_cell(point.checked_gap, 2),
                          seconds_cell(point.seconds.median)});
  }
  return table;
}

PageTable slow_table(const std::string& solver, const PageFacts& facts) {
  PageTable table{.caption = "Where " + solver + " is not the fastest",
                  .columns = {{"experiment", false, true},
                              {"set", false, true},
                              {"Q", true},
                              {"its time", true},
                              {"times the fastest", true},
                              {"the fastest", false, true},
                              {"time of the fastest", true}},
                  .rows = {},
                  .is_sortable = true};
  for (const ComparedPoint* each : comparable(facts)) {
    if (each->point.solver != solver || !(each->ratio > 1.0)) continue;
    table.rows.push_back({{each->point.experiment},
                          {each->point.family},
                          count_cell(each->point.candidates),
                          seconds_cell(each->point.seconds.median),
                          number_cell(each->ratio),
                          {each->fastest},
                          seconds_cell(each->fastest_seconds)});
  }
  return table;
}

PageSection comparison_section(const std::vector<PointSummary>& points) {
  PageSection section{.id = "comparison", .title = "Equal accuracy"};
  const std::vector<SolverRatio> ratios = solver_ratios(points);
  section.paragraphs = {
      fmt::format(
          "Times until the trace reached a gap, as the checker found it. A mean is "
          "geometric, shifted by {}. What was not solved, or not run, is charged ten times "
          "the longest time of any solver. The virtual best takes on each instance the time "
          "of whoever was fastest.",
          seconds_cell(kShift).text),
      "A ratio is the geometric mean over the instances that both have solved, so read their "
      "number "
      "beside it. Its interval is a bootstrap over families: draws and sizes of one family stay "
      "together. With one family there is none."};
  section.tables = {means_table(mean_times(points)), ratios_table(ratios)};
  return section;
}

PageSection failures_section(const PageFacts& facts) {
  PageSection section{.id = "failures", .title = "Where solvers fail or are slow"};
  PageTable failures = failures_table(facts);
  PageTable slow = slow_table(kDefaultSolver, facts);
  if (failures.rows.empty()) {
    section.paragraphs.push_back("Every solver solved every point that it was run on.");
  } else {
    section.paragraphs.push_back(fmt::format(
        "{} {} run and not solved. Those that were not run have a table of their own "
        "below.",
        counted(failures.rows.size(), "point"), failures.rows.size() == 1 ? "was" : "were"));
    section.tables.push_back(std::move(failures));
  }
  if (!slow.rows.empty()) section.tables.push_back(std::move(slow));
  return section;
}

}  // namespace graybox::bench
