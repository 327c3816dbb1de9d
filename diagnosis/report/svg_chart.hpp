// Small charts as SVG text, for a report that is one file and needs nothing else: lines, bands and
// points over linear or logarithmic axes, and heat maps. Each names itself for those who do not see
// it. Colours stand in attributes, which the page's style sheet replaces in the dark. (The study's
// figures are matplotlib's; a report is written where a user may have no Python.)
#pragma once

#include <string>
#include <vector>

namespace graybox {

struct ChartSeries {
  std::string name;          // in the legend; empty: not there
  std::vector<double> x, y;  // points that are not finite (or not positive on a log axis) are gaps
  std::string colour = "#0072b2";
  bool points = false;            // else a line
  double point_size = 3.0;        // their diameter
  std::vector<double> band = {};  // about each point of a line, half its width; empty: none
  std::string dash = {};          // of a line, as SVG's stroke-dasharray
};

struct ChartAxis {
  std::string label;
  bool logarithmic = false;
};

struct Chart {
  std::string title;
  ChartAxis x, y;
  std::vector<ChartSeries> series;
};

[[nodiscard]] std::string svg_chart(const Chart& chart);

// Values from white to dark, the scale beside them; NaN is an empty cell. `marked`: cells with a
// frame.
struct HeatMap {
  std::string title;
  std::string column_label, value_label;
  std::vector<std::string> rows, columns;
  std::vector<std::vector<double>> values;  // rows of columns
  std::vector<std::vector<bool>> marked;
  double lowest = 0.0, highest = 1.0;  // of the colour scale
  bool is_logarithmic = false;         // that scale
  bool has_numbers = false;            // in the cells, so that they are read without colour
  // Where a click leads: the recording by its key in page.js, and the edges of the columns.
  std::string recording = {};
  std::vector<double> edges = {};
};

[[nodiscard]] std::string svg_heat_map(const HeatMap& map);

// Text with the characters that HTML reserves written as entities.
[[nodiscard]] std::string html_escaped(const std::string& text);

}  // namespace graybox
