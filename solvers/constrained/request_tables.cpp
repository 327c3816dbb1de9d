#include "solvers/constrained/request_tables.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"
#include "problems/files/json_file.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox {
namespace {

constexpr double kMostRuns = 1e9;  // of one candidate

struct TextTable {
  std::vector<std::string> head;  // empty where the first line is numbers
  std::vector<std::vector<double>> rows;
};

// Whether blanks separate fields where nothing else does.
enum class Blanks : std::int8_t { kSeparate, kBelong };

std::string_view unquoted(std::string_view text) {
  const bool quoted = text.size() >= 2 && text.front() == '"' && text.back() == '"';
  return quoted ? text.substr(1, text.size() - 2) : text;
}

TextTable read_table(const std::string& path, Blanks blanks) {
  { const InputFile present(path); }
  LineReader lines(path);
  TextTable table;
  std::string_view line;
  std::vector<FieldSplitter> splitter;
  bool one_column = false;
  while (lines.next(line)) {
    if (splitter.empty()) {
      splitter.emplace_back(line);
      one_column =
          blanks == Blanks::kBelong && line.find_first_of(",;\t") == std::string_view::npos;
    }
    const std::vector<std::string_view> fields =
        one_column ? std::vector<std::string_view>{unquoted(line)} : splitter.front().split(line);
    if (table.rows.empty() && table.head.empty() && is_header(fields)) {
      table.head.assign(fields.begin(), fields.end());
      continue;
    }
    std::vector<double> row;
    for (std::size_t k = 0; k < fields.size(); ++k) {
      row.push_back(number_in_table(path, lines.number(), std::to_string(k + 1), fields[k]));
      if (!std::isfinite(row.back())) {
        throw InputError(fmt::format("{}: line {}, column {}: '{}' is not finite", path,
                                     lines.number(), k + 1, fields[k]));
      }
    }
    table.rows.push_back(std::move(row));
  }
  if (table.rows.empty()) throw InputError(fmt::format("{}: no numbers in it", path));
  return table;
}

void require_lines(const TextTable& table, const InformationSet& set, const std::string& path) {
  if (table.rows.size() != set.candidate_count()) {
    throw InputError(fmt::format("{}: {} lines of numbers for {} candidates; give one for each",
                                 path, table.rows.size(), set.candidate_count()));
  }
}

std::vector<double> done_in_design(const InformationSet& set, const std::string& path) {
  const auto root = read_json_file<nlohmann::json>(path);
  if (!root.is_object() || !root.contains("counts") || !root["counts"].is_array()) {
    throw InputError(fmt::format(
        "{}: no design with counts; write one by 'graybox exact -o', or CSV lines index,count",
        path));
  }
  for (const auto& [key, fits] : {std::pair{"candidates", nlohmann::json(set.candidate_count())},
                                  std::pair{"problem_hash", nlohmann::json(set.content_hash())}}) {
    if (root.contains(key) && root[key] != fits && root[key] != "") {
      throw InputError(fmt::format("{}: a design of another set: its {} is {}", path, key,
                                   root[key].dump().substr(0, 20)));
    }
  }
  std::vector<double> done(set.candidate_count(), 0.0);
  for (const auto& entry : root["counts"]) {
    const bool fits = entry.is_object() && entry.contains("index") && entry.contains("count") &&
                      entry["index"].is_number_unsigned() && entry["count"].is_number() &&
                      entry["index"] < set.candidate_count() && entry["count"] >= 0 &&
                      entry["count"] <= kMostRuns;
    if (!fits) throw InputError(fmt::format("{}: counts: {} is no count", path, entry.dump()));
    done[entry["index"].get<std::size_t>()] += entry["count"].get<double>();
  }
  return done;
}

// "left side <= 6" as a constraint without coefficients.
LinearConstraint constraint_head(const std::string& head, const std::string& path) {
  LinearConstraint row;
  for (const std::string_view comparison : {"<=", ">=", "="}) {
    const std::size_t at = head.find(comparison);
    if (at == std::string::npos) continue;
    double bound = 0.0;
    row.name = std::string(trimmed(std::string_view(head).substr(0, at)));
    if (!parse_number(trimmed(std::string_view(head).substr(at + comparison.size())), bound)) break;
    if (comparison != ">=") row.upper = bound;
    if (comparison != "<=") row.lower = bound;
    if (row.name.empty()) row.name = head;
    return row;
  }
  throw InputError(
      fmt::format("{}: the head '{}' must say name and bound, as in 'left side <= 6' (<=, >= or =)",
                  path, head));
}

}  // namespace

std::vector<double> candidate_numbers(const InformationSet& set, const std::string& name,
                                      const std::string& path, const std::string& what) {
  const auto& names = set.candidates().names;
  if (const auto found = std::ranges::find(names, name); found != names.end()) {
    std::vector<double> values(set.candidate_count());
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = set.coordinates(i)[static_cast<std::size_t>(found - names.begin())];
    }
    return values;
  }
  if (!std::filesystem::exists(path)) {
    throw InputError(
        fmt::format("{}: '{}' is neither a file nor a coordinate of the candidates", what, name));
  }
  const TextTable table = read_table(path, Blanks::kBelong);
  require_lines(table, set, path);
  std::vector<double> values;
  for (const auto& row : table.rows) {
    if (row.size() != 1) {
      throw InputError(fmt::format("{}: line {} holds {} numbers; {} takes one a candidate", path,
                                   values.size() + 1, row.size(), what));
    }
    values.push_back(row.front());
  }
  return values;
}

std::vector<double> experiments_done(const InformationSet& set, const std::string& path) {
  const InputFile file(path);
  if (file.head(1) == "{") return done_in_design(set, path);
  const TextTable table = read_table(path, Blanks::kSeparate);
  std::vector<double> done(set.candidate_count(), 0.0);
  for (const auto& row : table.rows) {
    const bool is_index = row.size() <= 2 && row[0] >= 0.0 && row[0] == std::floor(row[0]) &&
                          row[0] < static_cast<double>(set.candidate_count());
    if (!is_index || (row.size() == 2 && !(row[1] >= 0.0 && row[1] <= kMostRuns))) {
      throw InputError(fmt::format(
          "{}: '{}' is no line index,count with an index from 0 to {} and a count of at least 0",
          path, fmt::join(row, ","), set.candidate_count() - 1));
    }
    done[static_cast<std::size_t>(row[0])] += row.size() == 2 ? row[1] : 1.0;
  }
  return done;
}

std::vector<LinearConstraint> constraint_table(const InformationSet& set, const std::string& path) {
  const TextTable table = read_table(path, Blanks::kBelong);
  if (table.head.empty()) {
    throw InputError(
        fmt::format("{}: the first line must name the constraints, as in 'left side <= 6'", path));
  }
  require_lines(table, set, path);
  std::vector<LinearConstraint> rows;
  for (const std::string& head : table.head) rows.push_back(constraint_head(head, path));
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    if (table.rows[i].size() != rows.size()) {
      throw InputError(fmt::format("{}: candidate {} has {} numbers for {} constraints", path, i,
                                   table.rows[i].size(), rows.size()));
    }
    for (std::size_t j = 0; j < rows.size(); ++j) {
      rows[j].coefficients.push_back(table.rows[i][j]);
    }
  }
  return rows;
}

}  // namespace graybox
