#include <fmt/format.h>

#include <limits>
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

std::vector<RecordedColumn> header_columns(const std::string& path,
                                           const std::vector<std::string_view>& fields) {
  std::vector<RecordedColumn> columns;
  for (const std::string_view field : fields) {
    columns.push_back(titled(field));
    if (columns.back().name.empty()) {
      throw InputError(fmt::format("{}: header: column {} has no name", path, columns.size()));
    }
    for (std::size_t k = 0; k + 1 < columns.size(); ++k) {
      if (columns[k].name == columns.back().name) {
        throw InputError(
            fmt::format("{}: header: two columns are called '{}'", path, columns.back().name));
      }
    }
  }
  return columns;
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

// An empty field is a sample that is not there.
double sample_in(const std::string& path, std::size_t line, const std::string& column,
                 std::string_view field) {
  if (field.empty()) return std::numeric_limits<double>::quiet_NaN();
  return number_in_table(path, line, fmt::format("'{}'", column), field);
}

}  // namespace

RecordingFile read_csv_recording(const std::string& path, PackedText text) {
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  LineReader lines = text ? LineReader(path, *std::move(text)) : LineReader(path);
  std::string_view line;
  if (!lines.next(line)) throw InputError(path + ": there are no numbers");
  FieldSplitter splitter(line);
  bool more = true;
  if (const auto& titles = splitter.split(line); is_header(titles)) {
    file.columns = header_columns(path, titles);
    more = lines.next(line);
    if (more && takes_units(splitter.split(line), file.columns)) more = lines.next(line);
  } else {
    for (std::size_t k = 0; k < titles.size(); ++k) {
      file.columns.push_back({std::to_string(k + 1), {}, {}});
    }
  }
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
  return file;
}

}  // namespace graybox::formats
