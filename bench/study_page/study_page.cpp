#include "bench/study_page/study_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "bench/study_page/comparison_tables.hpp"
#include "bench/study_page/page_facts.hpp"
#include "bench/study_page/solver_sections.hpp"
#include "bench/study_page/study_page_tables.hpp"
#include "bench/study_page/study_plots.hpp"

namespace graybox::bench {
namespace {

std::size_t count_solved(const std::vector<RunRow>& runs) {
  return static_cast<std::size_t>(std::ranges::count(runs, ReportStatus::kSolved, &RunRow::status));
}

// The solver that is the fastest on most instances of the profile, and on how many.
std::pair<std::string, std::size_t> most_often_fastest(const ProfileData& profile) {
  std::map<std::string, std::size_t> wins;
  for (std::size_t i = 0; i < profile.instances.size(); ++i) {
    std::size_t best = 0;
    for (std::size_t s = 1; s < profile.solvers.size(); ++s) {
      if (profile.times[s][i] < profile.times[best][i]) best = s;
    }
    if (std::isfinite(profile.times[best][i])) ++wins[profile.solvers[best]];
  }
  const auto most = std::ranges::max_element(wins, {}, [](const auto& win) { return win.second; });
  if (most == wins.end()) return {};
  return {most->first, most->second};
}

// "2 of 9 runs are unsolved: 1 time_limit, 1 crashed."
std::string unsolved_words(const std::vector<RunRow>& runs) {
  std::map<std::string, std::size_t> counts;
  for (const RunRow& run : runs) {
    if (run.status != ReportStatus::kSolved) ++counts[std::string(to_string(run.status))];
  }
  std::string kinds;
  std::size_t unsolved = 0;
  for (const auto& [status, count] : counts) {
    unsolved += count;
    kinds += fmt::format("{}{} {}", kinds.empty() ? "" : ", ", count, status);
  }
  if (unsolved == 0) return {};
  return fmt::format("{} of {} {} unsolved: {}.", unsolved, counted(runs.size(), "run"),
                     unsolved == 1 ? "is" : "are", kinds);
}

// A tick is for a study without a run unsolved, a line unread or answers that disagree.
PageMark tone_of(const StudyRows& rows, bool agree) {
  if (!agree) return PageMark::kFailed;
  const bool is_whole = rows.unreadable == 0 && count_solved(rows.runs) == rows.runs.size();
  return is_whole && !rows.runs.empty() ? PageMark::kPassed : PageMark::kOpen;
}

void add_verdict(const StudyRows& rows, const ProfileData& profile,
                 const std::vector<Agreement>& agreements, ReportPage& page) {
  const bool agree = std::ranges::all_of(agreements, &Agreement::agrees);
  page.tone = tone_of(rows, agree);
  page.verdict =
      fmt::format("{} of {} solved", count_solved(rows.runs), counted(rows.runs.size(), "run"));
  for (const std::string& words :
       {unsolved_words(rows.runs), unreadable_note(rows, "rows.jsonl")}) {
    if (!words.empty()) page.sentences.push_back(words.back() == '.' ? words : words + ".");
  }
  page.sentences.push_back(agreement_words(agreements));
  if (const auto [solver, wins] = most_often_fastest(profile); wins > 0) {
    page.sentences.push_back(
        fmt::format("The fastest on most instances is {}: on {} of {}, to a checked gap of {}.",
                    solver, wins, profile.instances.size(), gap_words(kProfileGap)));
  }
  std::string names;
  for (const AbsentSolver& each : absent_of(rows)) names += (names.empty() ? "" : ", ") + each.name;
  if (!names.empty()) {
    page.sentences.push_back(
        fmt::format("Not compared, since they are not installed here: {}.", names));
  }
  page.sentences.push_back(
      "A run counts as solved where the checker proves its gap; what the solver says of itself "
      "does not count.");
}

PageSection points_section(const PageFacts& facts) {
  std::vector<const ComparedPoint*> all;
  for (const ComparedPoint& each : facts.points) all.push_back(&each);
  PageSection section{.id = "points", .title = "All points"};
  section.paragraphs = {
      "A point is one solver on one set. Times are medians of its runs. Press a head to sort, "
      "choose or type to filter."};
  section.tables = {points_table("Points", all, true)};
  return section;
}

}  // namespace

std::string study_page(const StudyRows& rows, const PageOrigin& origin) {
  const std::vector<PointSummary> points = summarise_points(rows.runs);
  const ProfileData profile = profile_data(points);
  const std::vector<SolverLaw> laws = fit_laws(points);
  const std::vector<Agreement> agreements = check_agreement(rows.runs);
  const std::vector<Headline> lines = headlines(points);
  const PageFacts facts = page_facts(points);
  ReportPage page{.title = "Study of solvers",
                  .verdict = {},
                  .sentences = {},
                  .bars = {},
                  .bars_title = {},
                  .sections = {},
                  .traces = {},
                  .origin = origin};
  add_verdict(rows, profile, agreements, page);
  page.plots = study_plots(facts, laws, profile);
  PageSection pictures{.id = "pictures", .title = "Figure 3 and profiles"};
  for (const ComparisonPlot& plot : page.plots) {
    pictures.figures.push_back(comparison_figure(plot));
  }
  if (!pictures.figures.empty()) page.sections.push_back(std::move(pictures));
  PageSection solvers{.id = "solvers", .title = "Solvers"};
  solvers.tables = {solvers_table(facts, laws)};
  if (!lines.empty()) solvers.tables.push_back(headlines_table(lines));
  page.sections.push_back(std::move(solvers));
  page.sections.push_back(comparison_section(points));
  page.sections.push_back(failures_section(facts));
  page.sections.push_back(points_section(facts));
  for (PageSection& section : solver_sections(facts)) page.sections.push_back(std::move(section));
  PageSection agreement{.id = "agreement", .title = "Agreement"};
  agreement.tables = {agreement_table(agreements)};
  page.sections.push_back(std::move(agreement));
  const std::vector<AbsentSolver> absent = absent_of(rows);
  PageSection not_run{.id = "skips", .title = "Not run"};
  if (!absent.empty()) not_run.tables.push_back(absent_table(absent));
  if (!rows.skips.empty()) not_run.tables.push_back(skips_table(rows.skips));
  if (!not_run.tables.empty()) page.sections.push_back(std::move(not_run));
  PageSection environment{.id = "environment", .title = "Environment"};
  environment.tables = {environment_table(rows)};
  page.sections.push_back(std::move(environment));
  return html_page(page);
}

}  // namespace graybox::bench
