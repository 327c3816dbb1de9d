#include <fmt/format.h>

#include <limits>
#include <string_view>
#include <utility>

#include "graybox/diagnosis/recordings/recording_formats.hpp"
#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/text_lines.hpp"
#include "graybox/problems/units.hpp"

namespace graybox::formats {
namespace {

// The first of these that occurs in the first line separates fields; else runs of blanks do.
char separator_of(std::string_view line) {
  for (const char separator : {';', ',', '\t'}) {
    if (line.find(separator) != std::string_view::npos) return separator;
  }
  return ' ';
}

std::vector<std::string_view> fields_of(std::string_view line, char separator) {
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t end = line.find(separator);
    std::string_view field = trimmed(line.substr(0, end));
    if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
      field = trimmed(field.substr(1, field.size() - 2));
    }
    fields.push_back(field);
    if (end == std::string_view::npos) return fields;
    line.remove_prefix(end + 1);
    if (separator == ' ') line = trimmed(line);  // a run of blanks separates once
  }
}

bool all_numbers(const std::vector<std::string_view>& fields) {
  double ignored = 0.0;
  for (const std::string_view field : fields) {
    if (!field.empty() && !parse_number(field, ignored)) return false;
  }
  return true;
}

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

double number_in(const std::string& path, std::size_t line, const std::string& column,
                 std::string_view field) {
  double value = std::numeric_limits<double>::quiet_NaN();
  if (field.empty() || parse_number(field, value)) return value;
  const bool decimal_comma = field.find(',') != std::string_view::npos;
  throw InputError(fmt::format("{}: line {}, column '{}': '{}' is no number{}", path, line, column,
                               field, decimal_comma ? "; write a decimal point" : ""));
}

}  // namespace

RecordingFile read_csv_recording(const std::string& path) {
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  LineReader lines(path);
  std::string_view line;
  if (!lines.next(line)) throw InputError(path + ": there are no numbers");
  const char separator = separator_of(line);
  std::vector<std::string_view> fields = fields_of(line, separator);
  bool more = true;
  if (all_numbers(fields)) {
    for (std::size_t k = 0; k < fields.size(); ++k) {
      file.columns.push_back({std::to_string(k + 1), {}, {}});
    }
  } else {
    file.columns = header_columns(path, fields);
    more = lines.next(line);
  }
  std::vector<std::vector<double>> values(file.columns.size());
  for (; more; more = lines.next(line)) {
    fields = fields_of(line, separator);
    if (fields.size() != values.size()) {
      throw InputError(fmt::format("{}: line {}: {} fields, but there are {} columns", path,
                                   lines.number(), fields.size(), values.size()));
    }
    for (std::size_t k = 0; k < values.size(); ++k) {
      values[k].push_back(number_in(path, lines.number(), file.columns[k].name, fields[k]));
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
