// Many curves in one picture, such as one for each solver: told apart by mark and dash as well as
// by colour, named in a list below that page's script turns into switches (compare.js).
//
//   ComparisonPlot plot{.id = "figure-3", .title = "Time against candidates", ...};
//   plot.series.push_back({.name = "column_generation", .words = "Q^0.24", .x = q, .y = seconds});
//   section.figures.push_back(comparison_figure(plot));   // html_page.hpp
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace graybox {

// How numbers along an axis are written: as they are, as seconds with a unit, as percentages.
enum class PlotNumber : std::int8_t { kPlain, kSeconds, kShare };

struct PlotAxis {
  std::string label;
  bool logarithmic = false;
  PlotNumber number = PlotNumber::kPlain;
  std::vector<double> ticks = {};  // empty: round numbers
};

struct PlotSeries {
  std::string name;
  std::string words = {};         // beside the name
  std::vector<double> x, y;       // x ascending; what is not finite is a gap
  std::vector<bool> hollow = {};  // marks of points that say something else; empty: none
  std::size_t style = 0;          // of the mark, dash and colour; the same for a name on a page
  bool is_heavy = false;
  bool has_line = true;
  bool has_marks = true;
  bool has_dots = false;  // instead of marks: many points
};

struct ComparisonPlot {
  std::string id;  // of letters, digits and -, unique in the page
  std::string title;
  PlotAxis x, y;
  std::vector<PlotSeries> series;
  bool has_steps = false;  // a series holds its value up to the next x, and to the right end
  std::string caption = {};
};

[[nodiscard]] std::string comparison_svg(const ComparisonPlot& plot);

// A short line, the mark or both, for the list of names.
[[nodiscard]] std::string series_swatch(const PlotSeries& series);

// The mark alone, about (0, 0).
[[nodiscard]] std::string series_mark(std::size_t style);

// What compare.js reads a value from: id, labels, the place of the axes in the picture, the points.
[[nodiscard]] nlohmann::ordered_json comparison_json(const ComparisonPlot& plot);

// "12.3 ms", "25 %", "7920".
[[nodiscard]] std::string plot_number(PlotNumber kind, double value);

}  // namespace graybox
