#include "diagnosis/design_page/design_charts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

namespace graybox {
namespace {

constexpr std::size_t kMostLevels = 200;  // of a coordinate, and points of a cloud of candidates
constexpr std::size_t kMostCells = 40;    // of a map, along one side
constexpr const char* kChosen = "#d55e00";
constexpr double kChosenSize = 6.0;
constexpr const char* kGrey = "#777777";
constexpr double kGap = std::numeric_limits<double>::quiet_NaN();  // lifts the pen

// The values of a coordinate, each a level of its own or, where they are too many, pieces of equal
// width.
class Levels {
 public:
  Levels(const InformationSet& set, std::size_t coordinate) : set_(set), coordinate_(coordinate) {
    std::set<double> values;
    for (std::size_t i = 0; i < set.candidate_count(); ++i) values.insert(value(i));
    distinct_ = values.size();
    low_ = *values.begin();
    high_ = *values.rbegin();
  }

  [[nodiscard]] double low() const { return low_; }
  [[nodiscard]] double high() const { return high_; }
  [[nodiscard]] bool is_constant() const { return distinct_ < 2; }
  [[nodiscard]] std::size_t count() const { return distinct_; }
  [[nodiscard]] double value(std::size_t candidate) const {
    return set_.coordinates(candidate)[coordinate_];
  }
  // Where a candidate stands along the axis: the middle of its piece, or its value.
  [[nodiscard]] double place(std::size_t candidate) const {
    if (distinct_ <= kMostLevels) return value(candidate);
    const double width = (high_ - low_) / static_cast<double>(kMostLevels);
    const double piece = std::min(std::floor((value(candidate) - low_) / width),
                                  static_cast<double>(kMostLevels - 1));
    return low_ + (piece + 0.5) * width;
  }

 private:
  const InformationSet& set_;
  std::size_t coordinate_, distinct_ = 0;
  double low_ = 0.0, high_ = 0.0;
};

ChartSeries bound_over(double from, double to) {
  ChartSeries bound{.name = "bound", .x = {from, to}, .y = {1.0, 1.0}, .colour = "#606060"};
  bound.dash = "6 3";
  return bound;
}

struct LevelSummary {
  double largest = 0.0, sum = 0.0, count = 0.0;
};

Chart sensitivity_chart(const DesignStory& story, std::size_t coordinate, const Levels& levels) {
  std::map<double, LevelSummary> summaries;
  for (std::size_t i = 0; i < story.sensitivities.size(); ++i) {
    if (!std::isfinite(story.sensitivities[i])) continue;
    LevelSummary& summary = summaries[levels.place(i)];
    summary.largest = std::max(summary.largest, story.sensitivities[i]);
    summary.sum += story.sensitivities[i];
    summary.count += 1.0;
  }
  ChartSeries line{.name = "largest", .x = {}, .y = {}};
  ChartSeries mean{.name = "mean", .x = {}, .y = {}, .colour = kGrey};
  mean.dash = "2 2";
  for (const auto& [at, summary] : summaries) {
    line.x.push_back(at);
    line.y.push_back(summary.largest);
    mean.x.push_back(at);
    mean.y.push_back(summary.sum / summary.count);
  }
  ChartSeries support{.name = "in the design", .x = {}, .y = {}, .colour = kChosen};
  support.points = true;
  support.point_size = kChosenSize;
  for (const ScheduledRun& run : story.schedule.runs) {
    support.x.push_back(levels.value(run.candidate));
    support.y.push_back(story.sensitivities[run.candidate]);
  }
  const CandidateTable& candidates = story.set->candidates();
  return {.title = "Sensitivity over " + candidates.names[coordinate],
          .x = {coordinate_head(candidates, coordinate)},
          .y = {"sensitivity / bound"},
          .series = {std::move(line), std::move(mean), bound_over(levels.low(), levels.high()),
                     std::move(support)}};
}

// A stroke from zero to each amount, and the axis that they stand on.
Chart stem_chart(const DesignStory& story, const std::map<double, double>& amounts, double from,
                 double to) {
  ChartSeries stems{.name = {}, .x = {}, .y = {}, .colour = kChosen};
  ChartSeries tops{.name = {}, .x = {}, .y = {}, .colour = kChosen};
  tops.points = true;
  tops.point_size = kChosenSize;
  for (const auto& [at, amount] : amounts) {
    stems.x.insert(stems.x.end(), {at, at, kGap});
    stems.y.insert(stems.y.end(), {0.0, amount, kGap});
    tops.x.push_back(at);
    tops.y.push_back(amount);
  }
  ChartSeries ground{.name = {}, .x = {from, to}, .y = {0.0, 0.0}, .colour = kGrey};
  return {.title = {},
          .x = {},
          .y = {story.schedule.has_counts ? "count" : "weight"},
          .series = {std::move(ground), std::move(stems), std::move(tops)}};
}

std::string amounts_word(const DesignStory& story) {
  return story.schedule.has_counts ? "counts" : "weights";
}

std::string capital(std::string words) {
  words.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(words.front())));
  return words;
}

Chart amount_chart(const DesignStory& story) {
  std::map<double, double> amounts;
  for (const ScheduledRun& run : story.schedule.runs) {
    amounts[static_cast<double>(run.candidate)] += run.amount;
  }
  Chart chart =
      stem_chart(story, amounts, 0.0, static_cast<double>(story.set->candidate_count() - 1));
  chart.title = fmt::format("{} of {} of {} candidates", capital(amounts_word(story)),
                            story.schedule.runs.size(), story.set->candidate_count());
  chart.x.label = "candidate";
  return chart;
}

Chart amount_chart(const DesignStory& story, std::size_t coordinate, const Levels& levels) {
  std::map<double, double> amounts;
  for (const ScheduledRun& run : story.schedule.runs) {
    amounts[levels.place(run.candidate)] += run.amount;
  }
  const CandidateTable& candidates = story.set->candidates();
  Chart chart = stem_chart(story, amounts, levels.low(), levels.high());
  chart.title =
      fmt::format("{} over {}", capital(amounts_word(story)), candidates.names[coordinate]);
  chart.x.label = coordinate_head(candidates, coordinate);
  return chart;
}

// Of many candidates the largest of each run of neighbours.
Chart sensitivity_chart(const DesignStory& story) {
  const std::vector<double>& values = story.sensitivities;
  const std::size_t run = (values.size() + 4 * kMostLevels - 1) / (4 * kMostLevels);
  ChartSeries all{.name = run > 1 ? fmt::format("largest of each {} candidates", run)
                                  : std::string("candidates"),
                  .x = {},
                  .y = {}};
  all.points = true;
  for (std::size_t first = 0; first < values.size(); first += run) {
    std::optional<std::size_t> largest;
    for (std::size_t i = first; i < std::min(first + run, values.size()); ++i) {
      if (std::isfinite(values[i]) && (!largest || values[i] > values[*largest])) largest = i;
    }
    if (!largest) continue;
    all.x.push_back(static_cast<double>(*largest));
    all.y.push_back(values[*largest]);
  }
  ChartSeries support{.name = "in the design", .x = {}, .y = {}, .colour = kChosen};
  support.points = true;
  support.point_size = kChosenSize;
  for (const ScheduledRun& each : story.schedule.runs) {
    support.x.push_back(static_cast<double>(each.candidate));
    support.y.push_back(values[each.candidate]);
  }
  return {.title = "Sensitivity of every candidate against the bound",
          .x = {"candidate"},
          .y = {"sensitivity / bound"},
          .series = {std::move(all), bound_over(0.0, static_cast<double>(values.size() - 1)),
                     std::move(support)}};
}

std::vector<std::string> labels(const std::map<double, std::size_t>& places) {
  std::vector<std::string> texts;
  for (const auto& [value, place] : places) texts.push_back(fmt::format("{:.4g}", value + 0.0));
  return texts;
}

// Value to its place in ascending order.
std::map<double, std::size_t> grid_of(const InformationSet& set, const Levels& levels) {
  std::map<double, std::size_t> places;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) places[levels.value(i)] = 0;
  std::size_t next = 0;
  for (auto& [value, place] : places) place = next++;
  return places;
}

// The largest sensitivity of each cell; what the design holds has a frame. The second coordinate
// grows upwards.
std::string sensitivity_map(const DesignStory& story, std::size_t x, std::size_t y) {
  const CandidateTable& candidates = story.set->candidates();
  const Levels across(*story.set, x), up(*story.set, y);
  const auto columns = grid_of(*story.set, across), rows = grid_of(*story.set, up);
  HeatMap map{.title = "Sensitivity / bound; framed: in the design",
              .column_label = coordinate_head(candidates, x),
              .value_label = "rows: " + coordinate_head(candidates, y),
              .rows = labels(rows),
              .columns = labels(columns),
              .values = std::vector(rows.size(), std::vector<double>(columns.size(), kGap)),
              .marked = std::vector(rows.size(), std::vector<bool>(columns.size(), false))};
  std::ranges::reverse(map.rows);
  const auto row_of = [&](std::size_t i) { return rows.size() - 1 - rows.at(up.value(i)); };
  for (std::size_t i = 0; i < story.sensitivities.size(); ++i) {
    double& cell = map.values[row_of(i)][columns.at(across.value(i))];
    cell = std::isnan(cell) ? story.sensitivities[i] : std::max(cell, story.sensitivities[i]);
    if (std::isfinite(cell)) map.highest = std::max(map.highest, cell);
  }
  for (const ScheduledRun& run : story.schedule.runs) {
    map.marked[row_of(run.candidate)][columns.at(across.value(run.candidate))] = true;
  }
  return svg_heat_map(map);
}

// A chart as a file: viewers show what has no ground on theirs, which may be dark.
std::string on_white(std::string svg) {
  const std::size_t end = svg.find('\n') + 1;
  return svg.insert(end, "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n");
}

std::string file_word(std::string_view name) {
  std::string word;
  for (const char letter : name) {
    const bool is_kept = std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '-';
    word += is_kept ? letter : '_';
  }
  return word;
}

class PictureList {
 public:
  void add(const std::string& name, std::string svg) {
    std::string own = file_word(name);
    for (int number = 2; !names_.insert(own).second; ++number) {
      own = fmt::format("{}_{}", file_word(name), number);
    }
    pictures_.push_back({.name = own, .svg = on_white(std::move(svg))});
  }
  [[nodiscard]] std::vector<DesignPicture> take() { return std::move(pictures_); }

 private:
  std::set<std::string> names_;
  std::vector<DesignPicture> pictures_;
};

struct Coordinate {
  std::size_t place;
  Levels levels;
};

// Those that vary.
std::vector<Coordinate> coordinates_of(const InformationSet& set) {
  std::vector<Coordinate> coordinates;
  for (std::size_t k = 0; k < set.candidates().names.size(); ++k) {
    Levels levels(set, k);
    if (!levels.is_constant()) coordinates.push_back({.place = k, .levels = levels});
  }
  return coordinates;
}

void add_sensitivities(const DesignStory& story, const std::vector<Coordinate>& coordinates,
                       PictureList& list) {
  if (story.sensitivities.empty()) return;
  list.add("sensitivities", svg_chart(sensitivity_chart(story)));
  for (const Coordinate& each : coordinates) {
    list.add("sensitivities_over_" + story.set->candidates().names[each.place],
             svg_chart(sensitivity_chart(story, each.place, each.levels)));
  }
  const bool is_grid =
      coordinates.size() == 2 && std::ranges::all_of(coordinates, [](const Coordinate& each) {
        return each.levels.count() <= kMostCells;
      });
  if (!is_grid) return;
  list.add("sensitivity_map", sensitivity_map(story, coordinates[0].place, coordinates[1].place));
}

}  // namespace

std::vector<Chart> sensitivity_charts(const DesignStory& story) {
  std::vector<Chart> charts;
  if (story.sensitivities.empty()) return charts;
  for (const Coordinate& each : coordinates_of(*story.set)) {
    charts.push_back(sensitivity_chart(story, each.place, each.levels));
  }
  return charts;
}

std::vector<DesignPicture> design_pictures(const DesignStory& story) {
  PictureList list;
  const std::string amounts = amounts_word(story);
  list.add(amounts, svg_chart(amount_chart(story)));
  const std::vector<Coordinate> coordinates = coordinates_of(*story.set);
  for (const Coordinate& each : coordinates) {
    list.add(amounts + "_over_" + story.set->candidates().names[each.place],
             svg_chart(amount_chart(story, each.place, each.levels)));
  }
  add_sensitivities(story, coordinates, list);
  return list.take();
}

}  // namespace graybox
