#include "diagnosis/report/svg_chart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/report/axis_scale.hpp"

namespace graybox {
namespace {

constexpr double kWidth = 480, kHeight = 310;
constexpr double kLeft = 70, kRight = 14, kTop = 64, kBottom = 44;
constexpr double kLetter = 6.6;  // width of one, on average

// "2e-5" and "1.2e5", not "2e-05" and "1.2e+05".
std::string label_of(double value) {
  if (value == 0.0) return "0";
  std::string text = fmt::format("{:.4g}", value);
  const std::size_t power = text.find('e');
  if (power == std::string::npos) return text;
  const std::size_t digits = text.find_first_not_of("+-0", power + 1);
  return text.substr(0, power + 1) + (text[power + 1] == '-' ? "-" : "") + text.substr(digits);
}

std::string opening(double width, double height, const std::string& says, const char* kind = "") {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:g} {1:g}\" "
      "width=\"{0:g}\" height=\"{1:g}\" font-family=\"sans-serif\" "
      "font-size=\"12\" role=\"img\" aria-label=\"{2}\"{3}>\n",
      width, height, html_escaped(says), kind);
}

std::string text_at(double x, double y, const std::string& text, const char* extra) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, extra,
                     html_escaped(text));
}

std::string says(const Chart& chart) {
  std::string text = "Chart: " + chart.title + "; " + chart.y.label + " against " + chart.x.label;
  for (const ChartSeries& series : chart.series) {
    if (!series.name.empty()) text += "; " + series.name;
  }
  return text;
}

std::string grid(const AxisScale& x, const AxisScale& y) {
  std::string svg;
  for (const double tick : x.ticks()) {
    const double at = x.place(tick);
    svg += fmt::format("<path d=\"M{:.1f} {:.1f}V{:.1f}\" stroke=\"#e0e0e0\"/>\n", at, kTop,
                       kHeight - kBottom);
    svg += text_at(at, kHeight - kBottom + 16, label_of(tick), "text-anchor=\"middle\"");
  }
  for (const double tick : y.ticks()) {
    const double at = y.place(tick);
    svg += fmt::format("<path d=\"M{:.1f} {:.1f}H{:.1f}\" stroke=\"#e0e0e0\"/>\n", kLeft, at,
                       kWidth - kRight);
    svg += text_at(kLeft - 6, at + 4, label_of(tick), "text-anchor=\"end\"");
  }
  return svg + fmt::format(
                   "<rect x=\"{:g}\" y=\"{:g}\" width=\"{:g}\" height=\"{:g}\" "
                   "fill=\"none\" stroke=\"#606060\"/>\n",
                   kLeft, kTop, kWidth - kLeft - kRight, kHeight - kTop - kBottom);
}

std::string labels(const Chart& chart) {
  const double middle = 0.5 * (kTop + kHeight - kBottom);
  return text_at(kLeft, 20, chart.title, "font-weight=\"bold\"") +
         text_at(0.5 * (kLeft + kWidth - kRight), kHeight - 10, chart.x.label,
                 "text-anchor=\"middle\"") +
         text_at(16, middle, chart.y.label,
                 fmt::format("text-anchor=\"middle\" transform=\"rotate(-90 16 {:.1f})\"", middle)
                     .c_str());
}

std::string band_of(const ChartSeries& series, const AxisScale& x, const AxisScale& y) {
  std::string above, below;
  const std::size_t count = std::min({series.x.size(), series.y.size(), series.band.size()});
  for (std::size_t i = 0; i < count; ++i) {
    const double low = series.y[i] - series.band[i], high = series.y[i] + series.band[i];
    if (!x.shows(series.x[i]) || !y.shows(low) || !y.shows(high)) continue;
    above += fmt::format("{}{:.1f} {:.1f}", above.empty() ? "M" : "L", x.place(series.x[i]),
                         y.place(high));
    below = fmt::format("L{:.1f} {:.1f}", x.place(series.x[i]), y.place(low)) + below;
  }
  if (above.empty()) return "";
  return fmt::format("<path d=\"{}{}Z\" fill=\"{}\" fill-opacity=\"0.22\"/>\n", above, below,
                     series.colour);
}

std::string dash_of(const ChartSeries& series) {
  return series.dash.empty() ? "stroke-linejoin=\"round\""
                             : fmt::format("stroke-dasharray=\"{}\"", series.dash);
}

std::string drawn(const ChartSeries& series, const AxisScale& x, const AxisScale& y) {
  const std::size_t count = std::min(series.x.size(), series.y.size());
  std::string shape;
  bool pen_down = false;
  for (std::size_t i = 0; i < count; ++i) {
    if (!x.shows(series.x[i]) || !y.shows(series.y[i])) {
      pen_down = false;
      continue;
    }
    const double px = x.place(series.x[i]), py = y.place(series.y[i]);
    if (series.points) {
      // Dots as round-capped strokes without length: far shorter than circles.
      shape += fmt::format("M{:.1f} {:.1f}h0", px, py);
    } else {
      shape += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", px, py);
    }
    pen_down = true;
  }
  if (series.points) {
    return fmt::format(
        "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{:g}\" "
        "stroke-linecap=\"round\" stroke-opacity=\"{:g}\"/>\n",
        shape, series.colour, series.point_size, series.point_size > 3.0 ? 1.0 : 0.6);
  }
  return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\" {}/>\n",
                     shape, series.colour, dash_of(series));
}

// One entry: what a line, points or a band look like, and the name.
std::string legend_entry(const ChartSeries& series, double left, double bottom) {
  std::string mark;
  if (!series.band.empty()) {
    mark += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"20\" height=\"10\" fill=\"{}\" "
        "fill-opacity=\"0.22\"/>\n",
        left, bottom - 9, series.colour);
  }
  if (series.points) {
    mark += fmt::format(
        "<path d=\"M{:.1f} {:.1f}h0m7 -2h0m7 3h0\" stroke=\"{}\" stroke-width=\"3\" "
        "stroke-linecap=\"round\"/>\n",
        left + 3, bottom - 4, series.colour);
  } else {
    mark += fmt::format("<path d=\"M{:.1f} {:.1f}h20\" stroke=\"{}\" stroke-width=\"2\" {}/>\n",
                        left, bottom - 4, series.colour, dash_of(series));
  }
  return mark + text_at(left + 25, bottom, series.name, "");
}

// In two lines of its own below the title, at most.
std::string legend(const std::vector<ChartSeries>& series) {
  std::string svg;
  double left = kLeft, bottom = 38;
  for (const ChartSeries& entry : series) {
    if (entry.name.empty()) continue;
    const double width = 25 + kLetter * static_cast<double>(entry.name.size());
    if (left > kLeft && left + width > kWidth) {
      left = kLeft;
      bottom += 16;
    }
    svg += legend_entry(entry, left, bottom);
    left += width + 14;
  }
  return svg;
}

std::string shade(double share) {
  // From near white to dark blue.
  const double t = std::clamp(share, 0.0, 1.0);
  const auto mix = [t](double from, double to) { return static_cast<int>(from + t * (to - from)); };
  return fmt::format("#{:02x}{:02x}{:02x}", mix(247, 8), mix(251, 48), mix(255, 107));
}

std::string colour_scale(const HeatMap& map, double x, double top, double height) {
  std::string svg;
  constexpr int kSteps = 24;
  for (int step = 0; step < kSteps; ++step) {
    svg += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.2f}\" width=\"12\" height=\"{:.2f}\" "
        "fill=\"{}\"/>\n",
        x, top + height * (kSteps - 1 - step) / kSteps, height / kSteps + 0.3,
        shade((step + 0.5) / kSteps));
  }
  svg += text_at(x + 16, top + 10, label_of(map.highest), "");
  svg += text_at(x + 16, top + height, label_of(map.lowest), "");
  return svg;
}

constexpr double kMapLine = 22, kMapHeading = 34;

struct MapLayout {
  double left = 0.0, cell = 0.0;
  std::size_t rows = 0, columns = 0;
  [[nodiscard]] double right() const { return left + cell * static_cast<double>(columns); }
  [[nodiscard]] double bottom() const { return top(rows); }
  [[nodiscard]] double top(std::size_t row) const {
    return kMapHeading + kMapLine * static_cast<double>(row);
  }
};

MapLayout layout_of(const HeatMap& map) {
  std::size_t longest = 4;
  for (const std::string& row : map.rows) longest = std::max(longest, row.size());
  MapLayout layout;
  layout.rows = map.rows.size();
  layout.columns = map.columns.size();
  layout.left = 12 + kLetter * static_cast<double>(longest);
  const auto columns = static_cast<double>(std::max<std::size_t>(1, map.columns.size()));
  layout.cell = std::clamp(380.0 / columns, map.has_numbers ? 26.0 : 12.0, 56.0);
  return layout;
}

// Two digits, or three where they are not behind a point.
std::string short_number(double value) {
  if (std::abs(value) >= 9999.5) return fmt::format("{:.0e}", value);
  return fmt::format("{:.{}f}", value, std::abs(value) < 9.95 ? 1 : 0);
}

// Where a value stands on the colour scale.
double share_of(const HeatMap& map, double value) {
  if (!std::isfinite(value)) return 0.0;
  if (!map.is_logarithmic) return (value - map.lowest) / (map.highest - map.lowest);
  return std::log(std::max(value, map.lowest) / map.lowest) / std::log(map.highest / map.lowest);
}

std::string map_cell(const HeatMap& map, const MapLayout& layout, std::size_t r, std::size_t c) {
  const double value = map.values[r][c];
  const double share = share_of(map, value);
  const bool marked = !map.marked.empty() && map.marked[r][c];
  const double x = layout.left + layout.cell * static_cast<double>(c), y = layout.top(r);
  std::string link;
  if (!map.recording.empty()) {
    link = fmt::format(" data-recording=\"{}\" data-from=\"{:.6g}\" data-to=\"{:.6g}\"",
                       html_escaped(map.recording), map.edges[c], map.edges[c + 1]);
  }
  std::string svg = fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" "
      "stroke=\"{}\" stroke-width=\"{}\"{}/>\n",
      x + 1, y + 1, layout.cell - 2, kMapLine - 2, std::isfinite(value) ? shade(share) : "none",
      marked ? "#d55e00" : "#d0d0d0", marked ? 2 : 1, link);
  if (!map.has_numbers || !std::isfinite(value)) return svg;
  return svg + text_at(x + 0.5 * layout.cell, y + 15, short_number(value),
                       share > 0.45 ? "text-anchor=\"middle\" font-size=\"9.5\" fill=\"#ffffff\" "
                                      "class=\"on-dark\" pointer-events=\"none\""
                                    : "text-anchor=\"middle\" font-size=\"9.5\" fill=\"#1d2127\" "
                                      "class=\"on-light\" pointer-events=\"none\"");
}

}  // namespace

std::string html_escaped(const std::string& text) {
  std::string escaped;
  for (const char letter : text) {
    switch (letter) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += letter;
    }
  }
  return escaped;
}

std::string svg_chart(const Chart& chart) {
  AxisScale x(chart.x.logarithmic, kLeft, kWidth - kRight);
  AxisScale y(chart.y.logarithmic, kHeight - kBottom, kTop);
  for (const ChartSeries& series : chart.series) {
    for (const double value : series.x) x.include(value);
    for (const double value : series.y) y.include(value);
    for (std::size_t i = 0; i < std::min(series.y.size(), series.band.size()); ++i) {
      y.include(series.y[i] - series.band[i]);
      y.include(series.y[i] + series.band[i]);
    }
  }
  x.settle();
  y.settle();
  std::string svg = opening(kWidth, kHeight, says(chart)) + grid(x, y) + labels(chart);
  for (const ChartSeries& series : chart.series) {
    svg += band_of(series, x, y) + drawn(series, x, y);
  }
  return svg + legend(chart.series) + "</svg>\n";
}

std::string svg_heat_map(const HeatMap& map) {
  const MapLayout layout = layout_of(map);
  std::string svg =
      opening(std::max(layout.right() + 78, 420.0), layout.bottom() + 72,
              fmt::format("Map: {}; {} rows of {} columns, along {}; {}", map.title,
                          map.rows.size(), map.columns.size(), map.column_label, map.value_label),
              " data-map=\"\"");
  svg += text_at(8, 20, map.title, "font-weight=\"bold\"");
  for (std::size_t r = 0; r < map.rows.size(); ++r) {
    svg += text_at(layout.left - 6, layout.top(r) + 15, map.rows[r], "text-anchor=\"end\"");
    for (std::size_t c = 0; c < map.columns.size(); ++c) svg += map_cell(map, layout, r, c);
  }
  const std::size_t stride =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(44.0 / layout.cell)));
  for (std::size_t c = 0; c < map.columns.size(); c += stride) {
    svg += text_at(layout.left + layout.cell * (static_cast<double>(c) + 0.5), layout.bottom() + 16,
                   map.columns[c], "text-anchor=\"middle\"");
  }
  svg += text_at(0.5 * (layout.left + layout.right()), layout.bottom() + 36, map.column_label,
                 "text-anchor=\"middle\"");
  svg += text_at(8, layout.bottom() + 60, map.value_label, "");
  svg += colour_scale(map, layout.right() + 12, kMapHeading,
                      std::max(40.0, layout.bottom() - kMapHeading));
  return svg + "</svg>\n";
}

}  // namespace graybox
