#include "diagnosis/report/html_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <kainjow/mustache.hpp>
#include <nlohmann/json.hpp>

#include "diagnosis/report/page_texts.hpp"
#include "problems/base/program_version.hpp"

namespace graybox {
namespace {

using kainjow::mustache::data;

constexpr std::size_t kTracePoints = 40000;  // in a page: about 1.5 MB

// In a script element nothing but "<" could end it.
std::string script_safe(std::string json) {
  for (std::size_t at = json.find('<'); at != std::string::npos; at = json.find('<', at)) {
    json.replace(at, 1, "\\u003c");
  }
  return json;
}

data flag(bool value) { return {value ? data::type::bool_true : data::type::bool_false}; }

template <typename Items, typename Convert>
data list_of(const Items& items, Convert convert) {
  data list{data::type::list};
  for (const auto& item : items) list << convert(item);
  return list;
}

data texts_of(const std::vector<std::string>& texts) {
  return list_of(texts, [](const std::string& text) { return data{"text", text}; });
}

const char* class_of(PageMark mark) {
  switch (mark) {
    case PageMark::kPassed:
      return "passed";
    case PageMark::kFailed:
      return "failed";
    case PageMark::kOpen:
      return "open";
    case PageMark::kNone:
      break;
  }
  return "none";
}

const char* sign_of(PageMark mark) {
  switch (mark) {
    case PageMark::kPassed:
      return "✓";
    case PageMark::kFailed:
      return "✗";
    case PageMark::kOpen:
      return "–";
    case PageMark::kNone:
      break;
  }
  return "";
}

data cell_of(const PageCell& cell, bool is_number) {
  data view;
  view.set("class", std::string(is_number ? "n " : "") + class_of(cell.mark));
  view.set("sign", sign_of(cell.mark));
  view.set("marked", flag(cell.mark != PageMark::kNone));
  view.set("text", cell.text);
  view.set("has_note", flag(!cell.note.empty()));
  view.set("note", cell.note);
  view.set("has_order", flag(std::isfinite(cell.order)));
  view.set("order", fmt::format("{:.9g}", cell.order));
  view.set("banded", flag(std::isfinite(cell.error_share)));
  view.set("share", fmt::format("{:.3g}", 100.0 * std::min(cell.error_share, 1.0)));
  return view;
}

data table_of(const PageTable& table) {
  data view;
  view.set("caption", table.caption);
  view.set("has_caption", flag(!table.caption.empty()));
  view.set("sortable", flag(table.is_sortable));
  view.set("columns", list_of(table.columns, [](const PageTable::Column& column) {
             data head{"head", column.head};
             head.set("class", column.is_number ? "n" : "");
             head.set("choice", flag(column.is_choice));
             return head;
           }));
  view.set("rows", list_of(table.rows, [&table](const std::vector<PageCell>& row) {
             data cells{data::type::list};
             for (std::size_t i = 0; i < row.size(); ++i) {
               data cell = cell_of(row[i], i < table.columns.size() && table.columns[i].is_number);
               cell.set("first", flag(i == 0));
               cells << cell;
             }
             return data{"cells", cells};
           }));
  return view;
}

data figure_of(const PageFigure& figure) {
  data view{"svg", figure.svg};
  view.set("has_caption", flag(!figure.caption.empty()));
  view.set("caption", figure.caption);
  view.set("has_keys", flag(!figure.keys.empty()));
  view.set("keys", list_of(figure.keys, [](const PageKey& key) {
             data entry{"name", key.name};
             entry.set("swatch", key.swatch);
             entry.set("words", key.words);
             return entry;
           }));
  return view;
}

bool has_sortable(const ReportPage& page) {
  return std::ranges::any_of(page.sections, [](const PageSection& section) {
    return std::ranges::any_of(section.tables, &PageTable::is_sortable);
  });
}

std::string percent_encoded(const std::string& text) {
  std::string encoded;
  for (const char letter : text) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(letter)) != 0 ||
                          std::string_view("-_.~").find(letter) != std::string_view::npos;
    encoded += is_plain ? std::string(1, letter)
                        : fmt::format("%{:02X}", static_cast<unsigned char>(letter));
  }
  return encoded;
}

data download_of(const PageDownload& download) {
  data view{"name", download.name};
  view.set("address", "data:text/plain;charset=utf-8," + percent_encoded(download.text));
  view.set("words", download.words);
  view.set("text", download.text);
  return view;
}

data section_of(const PageSection& section, const ReportPage& page) {
  data view{"id", section.id};
  view.set("title", section.title);
  view.set("listed", flag(section.is_listed));
  view.set("folded", flag(section.is_folded));
  view.set("open", flag(!section.is_folded));
  view.set("paragraphs", texts_of(section.paragraphs));
  view.set("has_points", flag(!section.points.empty()));
  view.set("points", texts_of(section.points));
  view.set("commands", texts_of(section.commands));
  view.set("downloads", list_of(section.downloads, download_of));
  view.set("tables", list_of(section.tables, table_of));
  view.set("has_figures", flag(!section.figures.empty()));
  view.set("figures", list_of(section.figures, figure_of));
  view.set("has_traces", flag(section.has_traces));
  view.set("stills", section.has_traces
                         ? list_of(page.traces,
                                   [](const Trace& trace) {
                                     return data{"svg", svg_chart(trace_chart(trace))};
                                   })
                         : data{data::type::list});
  return view;
}

data bar_of(const PageBar& bar) {
  data view{"name", bar.name};
  view.set("width", fmt::format("{:.1f}", 100.0 * std::clamp(bar.length, 0.0, 1.0)));
  view.set("words", bar.words);
  return view;
}

data file_of(const PageFile& file) {
  data view{"name", file.name};
  view.set("role", file.role);
  view.set("samples", file.samples > 0 ? std::to_string(file.samples) : std::string("–"));
  return view;
}

void set_origin(const PageOrigin& origin, data& view) {
  view.set("written_by", written_by());
  view.set("has_command", flag(!origin.command.empty()));
  view.set("command", origin.command);
  view.set("has_files", flag(!origin.files.empty()));
  view.set("files", list_of(origin.files, file_of));
  view.set("has_seconds", flag(std::isfinite(origin.seconds)));
  view.set("seconds", fmt::format("{:.{}f}", origin.seconds, origin.seconds < 10.0 ? 1 : 0));
}

nlohmann::ordered_json data_json(const ReportPage& page) {
  nlohmann::ordered_json json = traces_json(page.traces, kTracePoints);
  if (!page.plots.empty()) {
    for (const ComparisonPlot& plot : page.plots) json["plots"].push_back(comparison_json(plot));
  }
  if (!page.poses.empty()) {
    for (const PosePicture& picture : page.poses) json["poses"].push_back(pose_json(picture));
  }
  return json;
}

}  // namespace

PageCell with_band(PageCell cell, double value, double error) {
  cell.error_share =
      value == 0.0 ? std::numeric_limits<double>::quiet_NaN() : error / std::abs(value);
  return cell;
}

PageFigure comparison_figure(const ComparisonPlot& plot) {
  PageFigure figure{.svg = comparison_svg(plot), .caption = plot.caption};
  for (const PlotSeries& series : plot.series) {
    figure.keys.push_back({series_swatch(series), series.name, series.words});
  }
  return figure;
}

PageFigure pose_figure(const PosePicture& picture) {
  PageFigure figure{.svg = pose_svg(picture), .caption = picture.caption};
  for (const DrawnPose& pose : picture.poses) {
    PlotSeries series;
    series.name = pose.name;
    series.style = pose.style;
    series.has_line = false;
    figure.keys.push_back({series_swatch(series), pose.name, pose.words});
  }
  return figure;
}

std::string html_page(const ReportPage& page) {
  data view{"title", page.title};
  view.set("verdict", page.verdict);
  view.set("tone", class_of(page.tone));
  view.set("sign", sign_of(page.tone));
  view.set("sentences", texts_of(page.sentences));
  view.set("has_bars", flag(!page.bars.empty()));
  view.set("bars", list_of(page.bars, bar_of));
  view.set("bars_title", page.bars_title);
  view.set("sections", list_of(page.sections, [&page](const PageSection& section) {
             return section_of(section, page);
           }));
  set_origin(page.origin, view);
  const bool is_live = !page.traces.empty();
  const bool is_compared = !page.plots.empty() || has_sortable(page);
  view.set("is_live", flag(is_live));
  view.set("is_compared", flag(is_compared));
  view.set("has_poses", flag(!page.poses.empty()));
  view.set("has_data", flag(is_live || is_compared || !page.poses.empty()));
  view.set("data", script_safe(data_json(page).dump()));
  view.set("compare", page_texts::kCompare);
  view.set("turn_poses", page_texts::kPoses);
  view.set("style", page_texts::kStyle);
  view.set("dygraphs_style", page_texts::kDygraphsStyle);
  view.set("script", page_texts::kScript);
  view.set("dygraphs", page_texts::kDygraphs);
  view.set("synchronizer", page_texts::kSynchronizer);
  view.set("licences", page_texts::kLicences);
  return kainjow::mustache::mustache(page_texts::kTemplate).render(view);
}

}  // namespace graybox
