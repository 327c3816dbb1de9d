#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/recording_files/record_columns.hpp"
#include "diagnosis/recording_files/recording_formats.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"
#include "problems/files/json_file.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox::formats {
namespace {

using Json = nlohmann::json;

constexpr int kDeepest = 64;
constexpr std::size_t kBytesAByte = 10;  // of memory, parsed: 16 for a number of two characters

[[noreturn]] void fail(const std::string& path, const std::string& name, const char* problem) {
  throw InputError(fmt::format("{}: {}: {}", path, name.empty() ? "the array" : name, problem));
}

double number_in(const std::string& path, const std::string& name, const Json& value) {
  if (value.is_null()) return std::numeric_limits<double>::quiet_NaN();  // JSON has no NaN
  if (!value.is_number()) fail(path, name, "expected numbers");
  return value.get<double>();
}

// [[1, 2], [3, 4], ...] or [1, 2, ...].
void add_numbers(const std::string& name, const Json& array, RecordingFile& file) {
  const std::size_t width = array.front().is_array() ? array.front().size() : 1;
  std::vector<double> values;
  values.reserve(array.size() * width);
  for (const Json& row : array) {
    if (row.is_array() != array.front().is_array() || (row.is_array() && row.size() != width)) {
      fail(file.path, name, "its rows are of unequal length");
    }
    if (!row.is_array()) {
      values.push_back(number_in(file.path, name, row));
      continue;
    }
    for (const Json& value : row) values.push_back(number_in(file.path, name, value));
  }
  if (values.empty()) return;
  add_array(name, "", static_cast<Eigen::Index>(array.size()), static_cast<Eigen::Index>(width),
            values.data(), file);
}

bool holds_numbers(const Json& value) {
  if (!value.is_array() || value.empty()) return false;
  const Json& first = value.front();
  if (first.is_array())
    return !first.empty() && (first.front().is_number() || first.front().is_null());
  return first.is_number() || first.is_null();
}

bool are_records(const Json& value) {
  return value.is_array() && !value.empty() &&
         std::ranges::all_of(value, [](const Json& each) { return each.is_object(); });
}

// {"0": 1.5, "1": 1.6, ...}, as pandas writes a column.
bool are_numbered_values(const Json& value) {
  if (!value.is_object() || value.size() < 2) return false;
  return std::ranges::all_of(value.items(), [](const auto& item) {
    return !item.key().empty() && item.key().size() < 10 &&
           item.key().find_first_not_of("0123456789") == std::string::npos &&
           (item.value().is_number() || item.value().is_null());
  });
}

// In the order of their numbers: as text "10" comes before "9".
void add_numbered_values(const std::string& name, const Json& value, RecordingFile& file) {
  std::map<int, double> values;
  for (const auto& [key, number] : value.items()) {
    values.emplace(std::stoi(key), number_in(file.path, name, number));
  }
  std::vector<double> ordered;
  for (const auto& [place, number] : values) ordered.push_back(number);
  add_array(name, "", static_cast<Eigen::Index>(ordered.size()), 1, ordered.data(), file);
}

// Whether rows are arrays of so many values.
bool are_rows(const Json& value, std::size_t width) {
  return value.is_array() && !value.empty() && std::ranges::all_of(value, [&](const Json& row) {
           return row.is_array() && row.size() == width;
         });
}

// Different words; none where the value is something else.
std::vector<std::string> words_in(const Json& value) {
  if (!value.is_array()) return {};
  std::vector<std::string> words;
  for (const Json& word : value) {
    if (!word.is_string()) return {};
    words.push_back(word.get<std::string>());
  }
  const std::set<std::string> different(words.begin(), words.end());
  return different.size() == words.size() ? words : std::vector<std::string>{};
}

// A table that has its names apart, {"columns": ["t", "u"], "data": [[0, 1], ...]}.
struct NamedTable {
  std::vector<std::string> names;  // none where there is no such table
  const Json* rows = nullptr;
};

NamedTable named_table(const Json& root) {
  if (!root.is_object()) return {};
  for (const Json& each : root) {
    const std::vector<std::string> names = words_in(each);
    if (names.empty()) continue;
    const auto rows = std::ranges::find_if(
        root, [&](const Json& value) { return are_rows(value, names.size()); });
    if (rows != root.end()) return {names, &*rows};
  }
  return {};
}

// Rows of a table as records: they may hold words and time stamps.
void add_table(const NamedTable& table, RecordingFile& file) {
  RecordColumns records(file.path);
  for (const Json& row : *table.rows) {
    Json record = Json::object();
    for (std::size_t k = 0; k < table.names.size(); ++k) record[table.names[k]] = row[k];
    records.add(record);
  }
  file.columns = records.columns();
}

// The longest list of records within the value; null where there is none.
const Json* longest_records(const Json& value, int depth) {
  if (are_records(value)) return &value;
  if (!value.is_object() || depth > kDeepest) return nullptr;
  const Json* longest = nullptr;
  for (const Json& child : value) {
    const Json* found = longest_records(child, depth + 1);
    if (found != nullptr && (longest == nullptr || found->size() > longest->size())) {
      longest = found;
    }
  }
  return longest;
}

// Records within a file: what stands beside them are settings.
void add_records(const Json& list, RecordingFile& file) {
  RecordColumns records(file.path);
  for (const Json& record : list) records.add(record);
  for (RecordedColumn& column : records.columns()) {
    const bool is_taken = std::ranges::any_of(
        file.columns, [&](const RecordedColumn& each) { return each.name == column.name; });
    if (!is_taken) file.columns.push_back(std::move(column));
  }
}

void add_value(const std::string& name, const Json& value, int depth, RecordingFile& file) {
  if (depth > kDeepest) fail(file.path, name.substr(0, 40), "nested too deep; write fewer levels");
  if (are_numbered_values(value)) {
    add_numbered_values(name, value, file);
  } else if (value.is_object()) {
    for (const auto& [key, child] : value.items()) {
      add_value(name.empty() ? key : name + "." + key, child, depth + 1, file);
    }
  } else if (holds_numbers(value)) {
    add_numbers(name, value, file);
  }
}

// Whether each of the first two lines is an object by itself.
bool holds_json_lines(const std::string& path) {
  LineReader lines(path);
  std::string_view line;
  int objects = 0;
  while (objects < 2 && lines.next(line)) {
    if (!line.starts_with('{') || !Json::accept(line)) return false;
    ++objects;
  }
  return objects == 2;
}

}  // namespace

RecordingFile read_json_recording(const std::string& path, PackedText text) {
  if (!text && holds_json_lines(path)) return read_json_lines(path, {});
  require_memory(kBytesAByte * (text ? text->size() : InputFile(path).size()), path,
                 "write it as CSV or JSON lines, or use a part of it");
  const Json root = text ? parse_json<Json>(*text, path) : read_json_file<Json>(path);
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  const NamedTable table = named_table(root);
  if (root.is_array() && !root.empty() && root.front().is_object()) {
    add_records(root, file);
  } else if (table.rows != nullptr) {
    add_table(table, file);
  } else {
    add_value("", root, 0, file);
    const Json* records = longest_records(root, 0);
    if (records != nullptr) add_records(*records, file);
  }
  return file;
}

RecordingFile read_json_lines(const std::string& path, PackedText text) {
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  LineReader lines = text ? LineReader(path, *std::move(text)) : LineReader(path);
  RecordColumns records(path);
  std::string_view line;
  while (lines.next(line)) {
    records.add(parse_json<Json>(line, fmt::format("{}: line {}", path, lines.number())));
  }
  file.columns = records.columns();
  return file;
}

}  // namespace graybox::formats
