// A report as one self-contained HTML page: it loads nothing, and works without a script, on a
// phone, in the dark, on paper and without colours.
//
//   ReportPage page;
//   page.title = "Diagnosis";
//   page.sections.push_back({.id = "parameters", .title = "Parameters", .tables = {table}});
//   write_text_file("report.html", html_page(page));
//
// Texts are plain; html_page() escapes them. The template page.mustache has all HTML, page.js draws
// the traces with dygraphs from JSON in the page, compare.js makes tables sortable and charts of
// many curves readable point by point. A page with 40 000 points of traces takes less
// than 2 MB (trace.hpp).
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "diagnosis/report/comparison_plot.hpp"
#include "diagnosis/report/pose_picture.hpp"
#include "diagnosis/report/trace.hpp"

namespace graybox {

// A tick, a cross or a dash, beside the words that say the same.
enum class PageMark : std::int8_t { kNone, kPassed, kFailed, kOpen };

struct PageCell {
  std::string text;
  std::string note = {};  // small, below the text
  PageMark mark = PageMark::kNone;
  double order = std::numeric_limits<double>::quiet_NaN();  // sorts by it where it is finite
  // A standard error over the value, drawn as a band about the middle of a line from zero to twice
  // the value; none where it is not finite.
  double error_share = std::numeric_limits<double>::quiet_NaN();
};

struct PageTable {
  struct Column {
    std::string head;
    bool is_number = false;
    bool is_choice = false;  // of a sortable table: a menu of its values filters the rows
  };
  std::string caption;
  std::vector<Column> columns;
  std::vector<std::vector<PageCell>> rows;
  bool is_sortable = false;  // by a click on a head; with more than eight rows also to be filtered
};

// A name in the list below a figure.
struct PageKey {
  std::string swatch;  // SVG
  std::string name, words;
};

struct PageFigure {
  std::string svg;
  std::string caption = {};
  std::vector<PageKey> keys = {};
};

// A text that the reader can save, or copy.
struct PageDownload {
  std::string name, text, words;
};

struct PageSection {
  std::string id;  // of letters, unique in the page
  std::string title;
  std::vector<std::string> paragraphs = {};
  std::vector<std::string> points = {};    // a list
  std::vector<std::string> commands = {};  // to type
  std::vector<PageDownload> downloads = {};
  std::vector<PageTable> tables = {};
  std::vector<PageFigure> figures = {};
  bool has_traces = false;  // here is the place of ReportPage::traces
  bool is_folded = false;
  bool is_listed = true;  // in the contents at the top
};

// A length between 0 and 1 with words, in the card at the top.
struct PageBar {
  std::string name;
  double length = 0.0;
  std::string words;
};

struct PageFile {
  std::string name, role;
  std::size_t samples = 0;  // 0: not counted
};

// How the page came about.
struct PageOrigin {
  std::string command = {};
  std::vector<PageFile> files = {};
  double seconds = std::numeric_limits<double>::quiet_NaN();
};

struct ReportPage {
  std::string title;    // "Diagnosis of motor.yaml"
  std::string verdict;  // one word or two
  PageMark tone = PageMark::kNone;
  std::vector<std::string> sentences;  // three at most
  std::vector<PageBar> bars;
  std::string bars_title;
  std::vector<PageSection> sections;
  std::vector<Trace> traces;
  PageOrigin origin;
  std::vector<ComparisonPlot> plots = {};  // the data of comparison_figure() in the sections
  std::vector<PosePicture> poses = {};     // likewise of pose_figure()
};

// The cell with `error` of `value` drawn below its words.
[[nodiscard]] PageCell with_band(PageCell cell, double value, double error);

[[nodiscard]] PageFigure comparison_figure(const ComparisonPlot& plot);
[[nodiscard]] PageFigure pose_figure(const PosePicture& picture);

[[nodiscard]] std::string html_page(const ReportPage& page);

}  // namespace graybox
