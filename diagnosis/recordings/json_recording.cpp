#include <fmt/format.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "graybox/diagnosis/recordings/recording_formats.hpp"
#include "graybox/problems/error.hpp"

namespace graybox::formats {
namespace {

using Json = nlohmann::json;

constexpr int kDeepest = 64;

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

RecordingFile read_json_recording(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  const Json root = Json::parse(stream, nullptr, false);
  if (root.is_discarded()) {
    throw InputError(path +
                     ": not valid JSON, or truncated; note that JSON has no NaN, write null");
  }
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  add_value("", root, 0, file);
  return file;
}

}  // namespace graybox::formats
