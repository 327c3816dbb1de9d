#include "bench/study_page/solver_sections.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <map>
#include <utility>

#include "bench/study_page/study_page_tables.hpp"

namespace graybox::bench {
namespace {

PageSection section_of(const PageFacts& facts, const std::string& solver, std::size_t number) {
  const auto points = facts.of_solver(solver);
  PageSection section{.id = fmt::format("solver-{}", number), .title = solver};
  section.is_folded = true;
  section.is_listed = false;
  section.paragraphs = {
      fmt::format("Of its {}: {}.", counted(points.size(), "point"), status_words(points)),
      worst_words(points)};
  section.tables = {points_table("Points of " + solver, points, false)};
  return section;
}

}  // namespace

std::string status_words(const std::vector<const ComparedPoint*>& points) {
  std::map<std::string, std::size_t> counts;
  for (const ComparedPoint* each : points) ++counts[std::string(to_string(each->point.status))];
  std::vector<std::string> parts;
  for (const auto& [status, count] : counts) parts.push_back(fmt::format("{} {}", status, count));
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::string worst_words(const std::vector<const ComparedPoint*>& points) {
  const ComparedPoint* worst = worst_of(points);
  if (worst == nullptr) return "It was not run.";
  const PointSummary& point = worst->point;
  const std::string where = fmt::format("{} ({})", instance_name(point), point.experiment);
  if (!worst->is_solved()) {
    const std::string reached =
        std::isfinite(point.checked_gap)
            ? fmt::format("it ended with a gap of {:.2g} where {:.2g} was asked", point.checked_gap,
                          point.gap_asked)
            : fmt::format("it ended without a design, where a gap of {:.2g} was asked",
                          point.gap_asked);
    return fmt::format("Worst instance: {}: {} after {}; {}.{}", where, to_string(point.status),
                       seconds_cell(point.seconds.median).text, reached,
                       point.message.empty() ? "" : " It says: " + point.message + ".");
  }
  if (worst->ratio <= 1.0) {
    return fmt::format("Worst instance: none; it is the fastest on all, with {} on {}.",
                       seconds_cell(point.seconds.median).text, where);
  }
  return fmt::format("Worst instance: {}: solved in {}, {:.3g} times the fastest ({}, {}).", where,
                     seconds_cell(point.seconds.median).text, worst->ratio, worst->fastest,
                     seconds_cell(worst->fastest_seconds).text);
}

std::vector<PageSection> solver_sections(const PageFacts& facts) {
  PageSection first{.id = "solver-by-solver", .title = "Solver by solver"};
  first.paragraphs = {
      "What became of each solver, and where it did worst: what it did not solve, or the set on "
      "which it takes longest beside the fastest. Open a name to see its points."};
  std::vector<PageSection> sections{std::move(first)};
  for (std::size_t k = 0; k < facts.solvers.size(); ++k) {
    sections.push_back(section_of(facts, facts.solvers[k], k + 1));
  }
  return sections;
}

}  // namespace graybox::bench
