#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "diagnosis/recording_files/recording_formats.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox::formats {
namespace {

// "speed [rpm]" or "speed (rpm)" is the column speed in rpm.
RecordedColumn titled(std::string_view title) {
  for (const auto& [open, close] : {std::pair{'[', ']'}, std::pair{'(', ')'}}) {
    const std::size_t begin = title.rfind(open);
    if (begin == std::string_view::npos || begin == 0 || !title.ends_with(close)) continue;
    const std::string_view unit = trimmed(title.substr(begin + 1, title.size() - begin - 2));
    if (find_unit(unit) != nullptr) {
      return {std::string(trimmed(title.substr(0, begin))), std::string(unit), {}};
    }
  }
  return {std::string(title), {}, {}};
}

// Names of columns; those that are empty are left so.
std::vector<RecordedColumn> header_columns(const std::string& path,
                                           const std::vector<std::string_view>& fields) {
  std::vector<RecordedColumn> columns;
  for (const std::string_view field : fields) {
    columns.push_back(titled(field));
    for (std::size_t k = 0; k + 1 < columns.size(); ++k) {
      if (!columns[k].name.empty() && columns[k].name == columns.back().name) {
        throw InputError(
            fmt::format("{}: header: two columns are called '{}'", path, columns.back().name));
      }
    }
  }
  return columns;
}

// Names in the comment above the numbers, "# t u v" or "% t, u"; none where they don't fit.
std::vector<RecordedColumn> columns_in_comment(std::string_view comment, std::string_view first,
                                               std::size_t count) {
  comment = trimmed(comment.substr(std::min(comment.find_first_not_of("#% \t"), comment.size())));
  for (const std::string_view separated : {first, comment}) {
    const std::vector<std::string_view> titles = FieldSplitter(separated).split(comment);
    std::vector<RecordedColumn> columns;
    std::set<std::string> names;
    for (const std::string_view title : titles) {
      columns.push_back(titled(title));
      columns.back().number = std::to_string(columns.size());
      if (!columns.back().name.empty()) names.insert(columns.back().name);
    }
    if (names.size() == count && columns.size() == count && is_header(titles)) return columns;
  }
  return {};
}

// A line of units below the header: each field is a known unit, in brackets or not, "-" or empty,
// and one is a unit. Takes them.
bool takes_units(const std::vector<std::string_view>& fields,
                 std::vector<RecordedColumn>& columns) {
  if (fields.size() != columns.size()) return false;
  std::vector<std::string> units;
  bool any = false;
  for (std::string_view field : fields) {
    field = trimmed(field);
    const bool has_brackets = field.size() > 2 && (field.front() == '[' || field.front() == '(');
    if (has_brackets) field = trimmed(field.substr(1, field.size() - 2));
    const bool is_unit = find_unit(field) != nullptr && field != "1";
    if (!is_unit && !field.empty() && field != "-" && field != "1") return false;
    any = any || is_unit;
    units.emplace_back(is_unit ? field : std::string_view{});
  }
  for (std::size_t k = 0; any && k < columns.size(); ++k) {
    if (columns[k].unit.empty()) columns[k].unit = units[k];
  }
  return any;
}

// An empty field and an error of Excel are samples that are not there.
double sample_in(const std::string& path, std::size_t line, const std::string& column,
                 std::string_view field) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (field.empty()) return kNone;
  for (const std::string_view error :
       {"#VALUE!", "#DIV/0!", "#N/A", "#NUM!", "#REF!", "#NAME?", "#NULL!"}) {
    if (field == error) return kNone;
  }
  // What stands in a column without a name is a note.
  double number = kNone;
  if (column.empty()) return parse_number(field, number) ? number : kNone;
  return number_in_table(path, line, fmt::format("'{}'", column), field);
}

// The header, or numbers as names; the first line of numbers is in `line` then.
bool read_header(LineReader& lines, std::string_view& line, FieldSplitter& splitter,
                 std::string_view comment, RecordingFile& file) {
  const std::vector<std::string_view> fields = splitter.split(line);
  if (!is_header(fields)) {
    file.columns = columns_in_comment(comment, line, fields.size());
    if (!file.columns.empty()) return true;
    for (std::size_t k = 0; k < fields.size(); ++k) {
      file.columns.push_back({std::to_string(k + 1), {}, {}});
    }
    return true;
  }
  file.columns = header_columns(file.path, fields);
  bool more = lines.next(line);
  if (more && takes_units(splitter.split(line), file.columns)) more = lines.next(line);
  return more;
}

// A header may name the first of several columns only, as exported time series have it.
void name_the_rest(std::size_t fields, RecordingFile& file) {
  const std::size_t named = file.columns.size();
  if (fields <= named) return;
  for (std::size_t k = named; k < fields; ++k) {
    file.columns.push_back({std::to_string(k + 1), {}, {}});
  }
  file.remarks.push_back(
      fmt::format("{}: the header names {} of {} columns: the others are called by their numbers, "
                  "{} to {}",
                  file.path, named, fields, named + 1, fields));
}

// Columns without a name: called by their number, or left out where hardly any number stands.
void name_or_drop_unnamed(RecordingFile& file) {
  constexpr double kEnough = 0.5;  // of the rows
  std::string dropped;
  std::vector<RecordedColumn> kept;
  for (std::size_t k = 0; k < file.columns.size(); ++k) {
    RecordedColumn& column = file.columns[k];
    const auto numbers = static_cast<double>(column.values.array().isFinite().count());
    const bool is_unnamed = column.name.empty();
    if (is_unnamed && numbers < kEnough * static_cast<double>(column.values.size())) {
      if (numbers > 0.0) dropped += fmt::format("{}{}", dropped.empty() ? "" : ", ", k + 1);
      continue;
    }
    if (is_unnamed) column.name = std::to_string(k + 1);
    kept.push_back(std::move(column));
  }
  file.columns = std::move(kept);
  if (dropped.empty()) return;
  file.remarks.push_back(fmt::format(
      "{}: without a name and with hardly any number, so left out: column {}", file.path, dropped));
}

}  // namespace

RecordingFile read_csv_recording(const std::string& path, PackedText text) {
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  LineReader lines = text ? LineReader(path, *std::move(text)) : LineReader(path);
  std::string_view line;
  bool more = lines.next(line);
  std::string comment = lines.comment();
  for (; more && line.front() == '%'; more = lines.next(line)) comment = line;
  if (!more) throw InputError(path + ": there are no numbers");
  FieldSplitter splitter(line);
  more = read_header(lines, line, splitter, comment, file);
  if (more) name_the_rest(splitter.split(line).size(), file);
  std::vector<std::vector<double>> values(file.columns.size());
  for (; more; more = lines.next(line)) {
    const auto& fields = splitter.split(line);
    if (fields.size() != values.size()) {
      throw InputError(fmt::format("{}: line {}: {} fields, but there are {} columns", path,
                                   lines.number(), fields.size(), values.size()));
    }
    for (std::size_t k = 0; k < values.size(); ++k) {
      values[k].push_back(sample_in(path, lines.number(), file.columns[k].name, fields[k]));
    }
  }
  if (values.front().empty()) throw InputError(path + ": there is a header and no numbers");
  for (std::size_t k = 0; k < values.size(); ++k) {
    file.columns[k].values = Eigen::Map<const Eigen::VectorXd>(
        values[k].data(), static_cast<Eigen::Index>(values[k].size()));
  }
  name_or_drop_unnamed(file);
  if (file.columns.empty()) throw InputError(path + ": no column has a name or numbers");
  return file;
}

}  // namespace graybox::formats
