#include <fmt/format.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

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

void add_value(const std::string& name, const Json& value, int depth, RecordingFile& file) {
  if (depth > kDeepest) fail(file.path, name.substr(0, 40), "nested too deep; write fewer levels");
  if (value.is_object()) {
    for (const auto& [key, child] : value.items()) {
      add_value(name.empty() ? key : name + "." + key, child, depth + 1, file);
    }
  } else if (holds_numbers(value)) {
    add_numbers(name, value, file);
  }
}

}  // namespace

RecordingFile read_json_recording(const std::string& path, PackedText text) {
  require_memory(kBytesAByte * (text ? text->size() : InputFile(path).size()), path,
                 "write it as CSV or JSON lines, or use a part of it");
  const Json root = text ? parse_json<Json>(*text, path) : read_json_file<Json>(path);
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  if (root.is_array() && !root.empty() && root.front().is_object()) {
    RecordColumns records(path);
    for (const Json& record : root) records.add(record);
    file.columns = records.columns();
  } else {
    add_value("", root, 0, file);
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
