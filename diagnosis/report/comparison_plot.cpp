#include "diagnosis/report/comparison_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "diagnosis/report/axis_scale.hpp"
#include "diagnosis/report/svg_chart.hpp"

namespace graybox {
namespace {

constexpr double kPlotWidth = 560, kPlotHeight = 380;
constexpr double kPlotLeft = 80, kPlotRight = 16, kPlotTop = 34, kPlotBottom = 46;
constexpr std::size_t kMostMarks = 10;  // on a curve of steps

// Colours, marks and dashes go round with 7, 9 and 4: 252 styles until one comes again.
constexpr std::size_t kColours = 7;
constexpr std::array kMarks{
    "m-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z",
    "m-3.6 -3.6h7.2v7.2h-7.2z",
    "m0 -4.6l4.2 7.6h-8.4z",
    "m0 -4.8l4.8 4.8l-4.8 4.8l-4.8 -4.8z",
    "m0 4.6l4.2 -7.6h-8.4z",
    "m-1.4 -4.4h2.8v3h3v2.8h-3v3h-2.8v-3h-3v-2.8h3z",
    "m-4.2 -2.4l1.8 -1.8l2.4 2.4l2.4 -2.4l1.8 1.8l-2.4 2.4l2.4 2.4l-1.8 1.8l-2.4 -2.4l-2.4 "
    "2.4l-1.8 "
    "-1.8l2.4 -2.4z",
    "m0 -5l1.5 3.4l3.6 .3l-2.7 2.4l.8 3.6l-3.2 -1.9l-3.2 1.9l.8 -3.6l-2.7 -2.4l3.6 -.3z",
    "m-4.4 0l2.2 -3.8h4.4l2.2 3.8l-2.2 3.8h-4.4z"};
constexpr std::array kPlotDashes{"", "7 3", "2 2.5", "9 3 2 3"};

std::string mark_at(double x, double y, std::size_t style, bool is_hollow) {
  return fmt::format("<path d=\"M{:.1f} {:.1f}{}\" class=\"{}\"/>", x, y,
                     kMarks[style % kMarks.size()], is_hollow ? "hollow" : "mark");
}

std::string dash_attribute(std::size_t style) {
  const char* dash = kPlotDashes[style % kPlotDashes.size()];
  return *dash == '\0' ? std::string() : fmt::format(" stroke-dasharray=\"{}\"", dash);
}

struct PlotScales {
  AxisScale x, y;
};

PlotScales scales_of(const ComparisonPlot& plot) {
  PlotScales scales{{plot.x.logarithmic, kPlotLeft, kPlotWidth - kPlotRight},
                    {plot.y.logarithmic, kPlotHeight - kPlotBottom, kPlotTop}};
  for (const PlotSeries& series : plot.series) {
    for (std::size_t i = 0; i < std::min(series.x.size(), series.y.size()); ++i) {
      if (!scales.x.shows(series.x[i]) || !scales.y.shows(series.y[i])) continue;
      scales.x.include(series.x[i]);
      scales.y.include(series.y[i]);
    }
  }
  for (const double tick : plot.y.ticks) scales.y.include(tick);
  scales.x.settle();
  scales.y.settle();
  return scales;
}

std::string plot_text(double x, double y, const std::string& text, const std::string& extra) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, extra,
                     html_escaped(text));
}

// Ticks with a grid line each; a label only where the one before leaves room.
std::string x_grid(const ComparisonPlot& plot, const AxisScale& x) {
  std::string svg;
  double free_from = 0.0;
  for (const double tick : plot.x.ticks.empty() ? x.ticks() : plot.x.ticks) {
    const double at = x.place(tick);
    svg += fmt::format("<path d=\"M{:.1f} {:g}V{:g}\" stroke=\"#e0e0e0\"/>\n", at, kPlotTop,
                       kPlotHeight - kPlotBottom);
    const std::string label = plot_number(plot.x.number, tick);
    const double half = 3.6 * static_cast<double>(label.size());
    if (at - half < free_from) continue;
    free_from = at + half + 6.0;
    svg += plot_text(at, kPlotHeight - kPlotBottom + 16, label, "text-anchor=\"middle\"");
  }
  return svg;
}

std::string y_grid(const ComparisonPlot& plot, const AxisScale& y) {
  std::string svg;
  for (const double tick : plot.y.ticks.empty() ? y.ticks() : plot.y.ticks) {
    const double at = y.place(tick);
    svg += fmt::format("<path d=\"M{:g} {:.1f}H{:g}\" stroke=\"#e0e0e0\"/>\n", kPlotLeft, at,
                       kPlotWidth - kPlotRight);
    svg +=
        plot_text(kPlotLeft - 6, at + 4, plot_number(plot.y.number, tick), "text-anchor=\"end\"");
  }
  return svg;
}

std::string frame_and_labels(const ComparisonPlot& plot) {
  const double middle = 0.5 * (kPlotTop + kPlotHeight - kPlotBottom);
  return fmt::format(
             "<rect x=\"{:g}\" y=\"{:g}\" width=\"{:g}\" height=\"{:g}\" fill=\"none\" "
             "stroke=\"#606060\"/>\n",
             kPlotLeft, kPlotTop, kPlotWidth - kPlotLeft - kPlotRight,
             kPlotHeight - kPlotTop - kPlotBottom) +
         plot_text(8, 18, plot.title, "font-weight=\"bold\"") +
         plot_text(0.5 * (kPlotLeft + kPlotWidth - kPlotRight), kPlotHeight - 10, plot.x.label,
                   "text-anchor=\"middle\"") +
         plot_text(
             14, middle, plot.y.label,
             fmt::format("text-anchor=\"middle\" transform=\"rotate(-90 14 {:.1f})\"", middle));
}

// What of a curve is drawn, for a plot and for its name in the list.
std::string curve_group(const PlotSeries& series, const std::string& line, const std::string& dots,
                        const std::string& marks) {
  std::string svg =
      fmt::format("<g data-series=\"{}\" class=\"curve c{}{}\">", html_escaped(series.name),
                  series.style % kColours, series.is_heavy ? " heavy" : "");
  if (series.has_line) {
    svg += fmt::format("<path d=\"{}\" class=\"line\"{}/>", line, dash_attribute(series.style));
  }
  if (series.has_dots) svg += fmt::format("<path d=\"{}\" class=\"dots\"/>", dots);
  if (series.has_marks && !series.has_dots) svg += marks;
  return svg + "</g>\n";
}

std::string curve_of(const ComparisonPlot& plot, const PlotSeries& series,
                     const PlotScales& scales) {
  std::string line, marks, dots;
  const std::size_t count = std::min(series.x.size(), series.y.size());
  const std::size_t stride = plot.has_steps ? std::max<std::size_t>(1, count / kMostMarks) : 1;
  bool pen_down = false;
  for (std::size_t i = 0; i < count; ++i) {
    if (!scales.x.shows(series.x[i]) || !scales.y.shows(series.y[i])) {
      pen_down = false;
      continue;
    }
    const double x = scales.x.place(series.x[i]), y = scales.y.place(series.y[i]);
    if (!pen_down) line += fmt::format("M{:.1f} {:.1f}", x, y);
    if (pen_down && plot.has_steps) line += fmt::format("H{:.1f}V{:.1f}", x, y);
    if (pen_down && !plot.has_steps) line += fmt::format("L{:.1f} {:.1f}", x, y);
    pen_down = true;
    dots += fmt::format("M{:.1f} {:.1f}h0", x, y);
    const bool is_hollow = i < series.hollow.size() && series.hollow[i];
    if (i % stride == 0) marks += mark_at(x, y, series.style, is_hollow);
  }
  if (plot.has_steps && pen_down) line += fmt::format("H{:g}", kPlotWidth - kPlotRight);
  return curve_group(series, line, dots, marks);
}

nlohmann::ordered_json axis_json(const PlotAxis& axis, const AxisScale& scale, double from,
                                 double to) {
  const char* number = axis.number == PlotNumber::kSeconds ? "seconds"
                       : axis.number == PlotNumber::kShare ? "share"
                                                           : "plain";
  return {{"label", axis.label},
          {"logarithmic", axis.logarithmic},
          {"number", number},
          {"low", scale.low()},
          {"high", scale.high()},
          {"from", from},
          {"to", to}};
}

nlohmann::ordered_json rounded_list(const std::vector<double>& values) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const double value : values) {
    if (std::isfinite(value)) {
      list.push_back(std::strtod(fmt::format("{:.6g}", value).c_str(), nullptr));
    } else {
      list.push_back(nullptr);
    }
  }
  return list;
}

}  // namespace

std::string plot_number(PlotNumber kind, double value) {
  value += 0.0;  // no minus zero
  if (kind == PlotNumber::kShare) return fmt::format("{:.3g} %", 100.0 * value);
  if (kind == PlotNumber::kPlain) {
    return std::abs(value) >= 1e4 && std::abs(value) < 1e7 && value == std::floor(value)
               ? fmt::format("{:.0f}", value)
               : fmt::format("{:.4g}", value);
  }
  if (value < 0.9995e-3) return fmt::format("{:.3g} µs", 1e6 * value);
  if (value < 0.9995) return fmt::format("{:.3g} ms", 1e3 * value);
  return value < 999.5 ? fmt::format("{:.3g} s", value) : fmt::format("{:.0f} s", value);
}

std::string comparison_svg(const ComparisonPlot& plot) {
  const PlotScales scales = scales_of(plot);
  std::string says = fmt::format("Chart: {}; {} against {}; {} curves", plot.title, plot.y.label,
                                 plot.x.label, plot.series.size());
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" "
      "height=\"{1:g}\" font-family=\"sans-serif\" font-size=\"12\" role=\"img\" "
      "aria-label=\"{2}\" data-plot=\"{3}\">\n",
      kPlotWidth, kPlotHeight, html_escaped(says), html_escaped(plot.id));
  svg += x_grid(plot, scales.x) + y_grid(plot, scales.y) + frame_and_labels(plot);
  for (const bool heavy : {false, true}) {
    for (const PlotSeries& series : plot.series) {
      if (series.is_heavy == heavy) svg += curve_of(plot, series, scales);
    }
  }
  return svg + "</svg>\n";
}

std::string series_swatch(const PlotSeries& series) {
  return fmt::format(
      "<svg viewBox=\"0 0 40 12\" width=\"40\" height=\"12\" role=\"img\" "
      "aria-label=\"line and mark of {}\">{}</svg>",
      html_escaped(series.name),
      curve_group(series, "M1 6H39", "M12 6h0M20 8h0M28 5h0", mark_at(20, 6, series.style, false)));
}

std::string series_mark(std::size_t style) { return mark_at(0, 0, style, false); }

nlohmann::ordered_json comparison_json(const ComparisonPlot& plot) {
  const PlotScales scales = scales_of(plot);
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const PlotSeries& series : plot.series) {
    list.push_back(
        {{"name", series.name}, {"x", rounded_list(series.x)}, {"y", rounded_list(series.y)}});
  }
  return {{"id", plot.id},
          {"title", plot.title},
          {"steps", plot.has_steps},
          {"x", axis_json(plot.x, scales.x, kPlotLeft, kPlotWidth - kPlotRight)},
          {"y", axis_json(plot.y, scales.y, kPlotHeight - kPlotBottom, kPlotTop)},
          {"series", std::move(list)}};
}

}  // namespace graybox
