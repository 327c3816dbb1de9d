#include "solvers/report/design_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

using TableRow = std::vector<std::string>;

DesignSchedule scheduled(const InformationSet& set, const std::vector<ScheduledRun>& runs,
                         bool has_counts) {
  std::vector<std::size_t> candidates;
  for (const ScheduledRun& run : runs) candidates.push_back(run.candidate);
  DesignSchedule schedule{
      .runs = {}, .has_counts = has_counts, .order = run_order(set, candidates)};
  for (const std::size_t place : schedule.order.places) schedule.runs.push_back(runs[place]);
  return schedule;
}

std::vector<TableRow> rows_of(const InformationSet& set, const DesignSchedule& schedule) {
  std::vector<TableRow> rows;
  for (std::size_t k = 0; k < schedule.runs.size(); ++k) {
    const ScheduledRun& run = schedule.runs[k];
    TableRow& row = rows.emplace_back();
    row.push_back(std::to_string(k + 1));
    row.push_back(std::to_string(run.candidate));
    for (const double value : set.coordinates(run.candidate)) {
      row.push_back(fmt::format("{:.10g}", value + 0.0));  // no minus zero
    }
    row.push_back(schedule.has_counts ? fmt::format("{:.0f}", run.amount)
                                      : fmt::format("{:.8f}", run.amount));
  }
  return rows;
}

TableRow heads_of(const InformationSet& set, const DesignSchedule& schedule) {
  TableRow heads{"run", "candidate"};
  for (std::size_t k = 0; k < set.candidates().names.size(); ++k) {
    heads.push_back(coordinate_head(set.candidates(), k));
  }
  heads.push_back(schedule.has_counts ? "count" : "weight");
  return heads;
}

std::string with_escapes(const std::string& text,
                         const std::vector<std::pair<char, std::string_view>>& escapes) {
  std::string out;
  for (const char letter : text) {
    const auto found =
        std::ranges::find(escapes, letter, &std::pair<char, std::string_view>::first);
    if (found == escapes.end()) {
      out += letter;
    } else {
      out += found->second;
    }
  }
  return out;
}

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  return fmt::format("\"{}\"", with_escapes(text, {{'"', "\"\""}}));
}

std::string markdown_cell(const std::string& text) {
  return with_escapes(text, {{'|', "\\|"}, {'\n', " "}});
}

std::string latex_cell(const std::string& text) {
  return with_escapes(text, {{'_', "\\_"},
                             {'%', "\\%"},
                             {'&', "\\&"},
                             {'#', "\\#"},
                             {'$', "\\$"},
                             {'{', "\\{"},
                             {'}', "\\}"},
                             {'^', "\\textasciicircum{}"},
                             {'~', "\\textasciitilde{}"},
                             {'\\', "\\textbackslash{}"}});
}

TableRow converted(const TableRow& row, std::string (*cell)(const std::string&)) {
  TableRow out;
  for (const std::string& text : row) out.push_back(cell(text));
  return out;
}

std::string as_csv(const TableRow& heads, const std::vector<TableRow>& rows) {
  std::string text = fmt::format("{}\n", fmt::join(converted(heads, csv_cell), ","));
  for (const TableRow& row : rows) text += fmt::format("{}\n", fmt::join(row, ","));
  return text;
}

std::string as_markdown(const TableRow& heads, const std::vector<TableRow>& rows) {
  std::string text = fmt::format("| {} |\n|", fmt::join(converted(heads, markdown_cell), " | "));
  for (std::size_t k = 0; k < heads.size(); ++k) text += "---:|";
  text += "\n";
  for (const TableRow& row : rows) text += fmt::format("| {} |\n", fmt::join(row, " | "));
  return text;
}

std::string as_latex(const TableRow& heads, const std::vector<TableRow>& rows) {
  std::string text =
      fmt::format("\\begin{{tabular}}{{{}}}\n\\hline\n{} \\\\\n\\hline\n",
                  std::string(heads.size(), 'r'), fmt::join(converted(heads, latex_cell), " & "));
  for (const TableRow& row : rows) text += fmt::format("{} \\\\\n", fmt::join(row, " & "));
  return text + "\\hline\n\\end{tabular}\n";
}

}  // namespace

DesignSchedule design_schedule(const InformationSet& set, std::span<const double> weights,
                               double least) {
  std::vector<ScheduledRun> runs;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] > 0.0 && weights[i] >= least) runs.push_back({i, weights[i]});
  }
  return scheduled(set, runs, false);
}

DesignSchedule design_schedule(const InformationSet& set, std::span<const std::int64_t> counts) {
  std::vector<ScheduledRun> runs;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] > 0) runs.push_back({i, static_cast<double>(counts[i])});
  }
  return scheduled(set, runs, true);
}

std::span<const std::string_view> table_formats() {
  static constexpr std::array<std::string_view, 3> kNames{"csv", "markdown", "latex"};
  return kNames;
}

TableFormat table_format(std::string_view name) {
  const auto known = table_formats();
  const auto found = std::ranges::find(known, name);
  if (found == known.end()) {
    throw InputError(fmt::format("--format {}: choose one of {}", name, fmt::join(known, ", ")));
  }
  return static_cast<TableFormat>(found - known.begin());  // in the order of the names
}

std::string design_table(const InformationSet& set, const DesignSchedule& schedule,
                         TableFormat format) {
  const TableRow heads = heads_of(set, schedule);
  const std::vector<TableRow> rows = rows_of(set, schedule);
  switch (format) {
    case TableFormat::kCsv:
      return as_csv(heads, rows);
    case TableFormat::kMarkdown:
      return as_markdown(heads, rows);
    case TableFormat::kLatex:
      break;
  }
  return as_latex(heads, rows);
}

std::string coordinate_head(const CandidateTable& table, std::size_t k) {
  const bool has_unit = k < table.units.size() && !table.units[k].empty();
  return has_unit ? fmt::format("{} [{}]", table.names[k], table.units[k]) : table.names[k];
}

}  // namespace graybox
