// Small charts as SVG text, for a report that is one file and needs nothing else: lines and points
// over linear or logarithmic axes, and heat maps. (The study's figures are matplotlib's; a report
// is written where a user may have no Python.)
#pragma once

#include <string>
#include <vector>

namespace graybox {

struct ChartSeries {
  std::string name;          // in the legend; empty: not there
  std::vector<double> x, y;  // points that are not finite (or not positive on a log axis) are gaps
  std::string colour = "#0072b2";
  bool points = false;            // else a line
  std::vector<double> bars = {};  // of each point, half their length; empty: none
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
};

[[nodiscard]] std::string svg_heat_map(const HeatMap& map);

// Text with the characters that HTML reserves written as entities.
[[nodiscard]] std::string html_escaped(const std::string& text);

// About `count` round numbers from `low` to `high`.
[[nodiscard]] std::vector<double> round_ticks(double low, double high, int count);

}  // namespace graybox
