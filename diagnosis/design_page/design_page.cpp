#include "diagnosis/design_page/design_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "diagnosis/design_page/design_charts.hpp"
#include "diagnosis/design_page/robot_poses.hpp"

namespace graybox {
namespace {

constexpr std::size_t kMostPoints = 800;  // of the certificate's picture
constexpr std::size_t kMostPoses = 24;
constexpr std::size_t kMostBars = 8;

std::string candidate_name(std::size_t candidate) { return fmt::format("candidate {}", candidate); }

double total_of(const DesignSchedule& schedule) {
  double total = 0.0;
  for (const ScheduledRun& run : schedule.runs) total += run.amount;
  return total;
}

std::string amount_text(const DesignSchedule& schedule, double amount) {
  return schedule.has_counts ? fmt::format("{:.0f}", amount) : fmt::format("{:.5f}", amount);
}

// Heaviest first.
std::vector<ScheduledRun> heaviest(const DesignSchedule& schedule, std::size_t most) {
  std::vector<ScheduledRun> runs = schedule.runs;
  std::ranges::stable_sort(runs, std::greater<>(), &ScheduledRun::amount);
  if (runs.size() > most) runs.resize(most);
  return runs;
}

std::string order_words(const DesignSchedule& schedule) {
  const RunOrder& order = schedule.order;
  if (order.length == 0.0) return "The set has no coordinates, so that any order is as good.";
  const std::string what = order.unit.empty() ? "ranges of a coordinate" : order.unit;
  return fmt::format(
      "Run them in this order: {} {} are travelled in all, where a step counts by its largest "
      "change of one coordinate. {}",
      fmt::format("{:.5g}", order.length), what,
      order.is_shortest ? "No order is shorter." : "A shorter order may exist.");
}

PageTable schedule_table(const DesignStory& story) {
  const CandidateTable& candidates = story.set->candidates();
  PageTable table{.caption = "What to run",
                  .columns = {{"run", true}, {"candidate", true}},
                  .rows = {},
                  .is_sortable = true};
  for (std::size_t k = 0; k < candidates.names.size(); ++k) {
    table.columns.push_back({coordinate_head(candidates, k), true});
  }
  table.columns.push_back({story.schedule.has_counts ? "count" : "weight", true});
  if (!story.sensitivities.empty()) table.columns.push_back({"sensitivity / bound", true});
  for (std::size_t k = 0; k < story.schedule.runs.size(); ++k) {
    const ScheduledRun& run = story.schedule.runs[k];
    std::vector<PageCell> row{
        {.text = std::to_string(k + 1), .order = static_cast<double>(k + 1)},
        {.text = std::to_string(run.candidate), .order = static_cast<double>(run.candidate)}};
    for (const double value : story.set->coordinates(run.candidate)) {
      row.push_back({.text = fmt::format("{:.6g}", value + 0.0), .order = value});
    }
    row.push_back({.text = amount_text(story.schedule, run.amount), .order = run.amount});
    if (!story.sensitivities.empty()) {
      const double value = story.sensitivities[run.candidate];
      row.push_back({.text = fmt::format("{:.6f}", value), .order = value});
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

PageSection design_section(const DesignStory& story) {
  PageSection section{.id = "design", .title = "What to run"};
  section.paragraphs = {order_words(story.schedule)};
  section.tables = {schedule_table(story)};
  section.downloads = {{"design.csv", design_table(*story.set, story.schedule, TableFormat::kCsv),
                        "the same as a table"}};
  return section;
}

PageSection numbers_section(const DesignStory& story) {
  PageSection section{.id = "numbers", .title = "How good it is"};
  PageTable table{"Numbers and what they mean", {{"what"}, {"value", true}, {"what it means"}}, {}};
  for (const DesignFact& fact : story.facts) {
    table.rows.push_back({{fact.name}, {fact.value}, {fact.meaning}});
  }
  section.tables = {std::move(table)};
  return section;
}

PageSection parameters_section(const DesignStory& story) {
  PageSection section{.id = "parameters", .title = "What will be known"};
  section.paragraphs = {story.error_words};
  PageTable table{.caption = "Standard errors of the parameters",
                  .columns = {{"parameter"}, {"standard error", true}},
                  .rows = {},
                  .is_sortable = true};
  for (std::size_t k = 0; k < story.standard_errors.size(); ++k) {
    const std::vector<std::string>& names = story.set->parameters();
    table.rows.push_back({{names.empty() ? fmt::format("parameter {}", k) : names[k]},
                          {.text = fmt::format("{:.4g}", story.standard_errors[k]),
                           .order = story.standard_errors[k]}});
  }
  section.tables = {std::move(table)};
  return section;
}

PageSection certificate_section(const DesignStory& story, ReportPage& page) {
  PageSection section{.id = "certificate", .title = "Why it can't be better"};
  section.paragraphs = {story.sensitivity_words};
  page.plots.push_back(certificate_plot(story));
  section.figures.push_back(comparison_figure(page.plots.back()));
  for (const Chart& chart : sensitivity_charts(story))
    section.figures.push_back({svg_chart(chart)});
  return section;
}

std::string limit_words(const DesignStory& story) {
  std::size_t beyond = 0;
  for (const ScheduledRun& run : story.schedule.runs) {
    beyond +=
        count_beyond_limits(*story.robot, story.set->coordinates(run.candidate)) > 0 ? 1U : 0U;
  }
  if (beyond > 0) {
    return fmt::format("{} of the poses lie beyond the limits of the robot's joints.", beyond);
  }
  return "All poses lie within the limits of the robot's joints, and so do straight moves of the "
         "joints between them.";
}

PageSection poses_section(const DesignStory& story, ReportPage& page) {
  PosePicture picture{.id = "poses",
                      .title = "Poses of " + story.robot->name,
                      .caption =
                          "Lines run from the base through the joints to the centre of mass of the "
                          "last body; thicker poses are run more often.",
                      .poses = {}};
  const double total = total_of(story.schedule);
  for (const ScheduledRun& run : heaviest(story.schedule, kMostPoses)) {
    picture.poses.push_back(
        {.name = candidate_name(run.candidate),
         .words = amount_text(story.schedule, run.amount),
         .share = run.amount / total,
         .points = robot_pose(*story.robot, story.set->coordinates(run.candidate)),
         .style = picture.poses.size()});
  }
  PageSection section{.id = "robot", .title = "The robot's poses"};
  section.paragraphs = {limit_words(story)};
  if (story.schedule.runs.size() > kMostPoses) {
    section.paragraphs.push_back(
        fmt::format("The {} heaviest of {} are drawn.", kMostPoses, story.schedule.runs.size()));
  }
  section.figures = {pose_figure(picture)};
  page.poses.push_back(std::move(picture));
  return section;
}

void add_bars(const DesignStory& story, ReportPage& page) {
  const double total = total_of(story.schedule);
  for (const ScheduledRun& run : heaviest(story.schedule, kMostBars)) {
    page.bars.push_back({candidate_name(run.candidate), run.amount / total,
                         amount_text(story.schedule, run.amount)});
  }
  page.bars_title =
      fmt::format("{} of the {} candidates", story.schedule.has_counts ? "Counts" : "Weights",
                  story.schedule.runs.size() > kMostBars ? fmt::format("{} heaviest", kMostBars)
                                                         : std::string("chosen"));
}

// What is missing is said.
PageSection section_without_picture() {
  PageSection section{.id = "certificate", .title = "The proof"};
  section.paragraphs = {
      "There is no picture of the proof: this design does not carry what its sensitivities are "
      "computed from. The numbers above are those of the checker."};
  return section;
}

}  // namespace

ComparisonPlot certificate_plot(const DesignStory& story) {
  const std::vector<double>& values = story.sensitivities;
  const std::size_t run = (values.size() + kMostPoints - 1) / kMostPoints;
  PlotSeries all{
      .name = run > 1 ? fmt::format("largest of {} candidates", run) : std::string("candidates"),
      .x = {},
      .y = {},
      .style = 1};
  all.has_line = false;
  all.has_dots = true;
  for (std::size_t first = 0; first < values.size(); first += run) {
    const auto from = values.begin() + static_cast<std::ptrdiff_t>(first);
    const auto end =
        values.begin() + static_cast<std::ptrdiff_t>(std::min(first + run, values.size()));
    const auto largest = std::ranges::max_element(from, end, {}, [](double value) {
      return std::isnan(value) ? -std::numeric_limits<double>::infinity() : value;
    });
    all.x.push_back(static_cast<double>(largest - values.begin()));
    all.y.push_back(*largest);
  }
  PlotSeries bound{.name = "bound of an optimal design", .x = {}, .y = {1.0, 1.0}, .style = 0};
  bound.x = {0.0, static_cast<double>(values.size() - 1)};
  bound.has_marks = false;
  PlotSeries support{.name = "in the design", .x = {}, .y = {}, .style = 2};
  support.has_line = false;
  std::vector<std::size_t> chosen;
  for (const ScheduledRun& each : story.schedule.runs) chosen.push_back(each.candidate);
  std::ranges::sort(chosen);
  for (const std::size_t candidate : chosen) {
    support.x.push_back(static_cast<double>(candidate));
    support.y.push_back(values[candidate]);
  }
  return {.id = "certificate-plot",
          .title = "Sensitivity of every candidate against the bound",
          .x = {.label = "candidate"},
          .y = {.label = "sensitivity / bound"},
          .series = {std::move(all), std::move(bound), std::move(support)},
          .caption =
              run > 1 ? fmt::format("Of every {} neighbouring candidates the largest value.", run)
                      : std::string()};
}

std::string design_page(const DesignStory& story, const PageOrigin& origin) {
  ReportPage page{.title = story.title,
                  .verdict = story.verdict,
                  .tone = story.tone,
                  .sentences = story.sentences,
                  .bars = {},
                  .bars_title = {},
                  .sections = {},
                  .traces = {},
                  .origin = origin};
  add_bars(story, page);
  page.sections.push_back(design_section(story));
  if (!story.facts.empty()) page.sections.push_back(numbers_section(story));
  if (!story.sensitivities.empty()) page.sections.push_back(certificate_section(story, page));
  if (story.sensitivities.empty()) page.sections.push_back(section_without_picture());
  if (!story.standard_errors.empty()) page.sections.push_back(parameters_section(story));
  if (story.robot != nullptr) page.sections.push_back(poses_section(story, page));
  return html_page(page);
}

}  // namespace graybox
